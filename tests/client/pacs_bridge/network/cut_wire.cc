// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/pacs_bridge/network/cut_wire.h"

#include <algorithm>
#include <array>
#include <unistd.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform::testing {
namespace {

constexpr size_t kPduHeaderBytes = 6;
// Type, a reserved byte, the length, and four bytes: by the service's user, no reason.
constexpr std::array<char, 10> kAbort = {7, 0, 0, 0, 0, 4, 0, 0, 0, 0};

sockaddr_in Loopback(int port) {
  sockaddr_in place = {};
  place.sin_family = AF_INET;
  place.sin_port = htons(static_cast<uint16_t>(port));
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return place;
}

bool ReadWhole(int socket, char* bytes, size_t count) {
  for (size_t done = 0; done < count;) {
    const ssize_t read_now = read(socket, bytes + done, count - done);
    if (read_now <= 0) return false;
    done += static_cast<size_t>(read_now);
  }
  return true;
}

void WriteAll(int socket, const char* bytes, size_t count) {
  for (size_t done = 0; done < count;) {
    const ssize_t sent = send(socket, bytes + done, count - done, MSG_NOSIGNAL);
    if (sent <= 0) return;
    done += static_cast<size_t>(sent);
  }
}

// What the other end answers, as it comes, until it closes.
void PassBack(int from, int to) {
  std::array<char, 4096> piece;
  for (ssize_t count; (count = read(from, piece.data(), piece.size())) > 0;) {
    WriteAll(to, piece.data(), static_cast<size_t>(count));
  }
  shutdown(to, SHUT_RDWR);
}

}  // namespace

CutWire::CutWire(int port, int64_t bytes, WireEnd end)
    : target_(port),
      bytes_(bytes),
      end_(end),
      listener_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in place = Loopback(0);
  socklen_t length = sizeof(place);
  const bool listens = bind(listener_, reinterpret_cast<sockaddr*>(&place), length) == 0 &&
                       listen(listener_, 1) == 0 &&
                       getsockname(listener_, reinterpret_cast<sockaddr*>(&place), &length) == 0;
  port_ = listens ? ntohs(place.sin_port) : 0;
  thread_ = std::thread([this] { Run(); });
}

CutWire::~CutWire() {
  shutdown(listener_, SHUT_RDWR);
  thread_.join();
  close(listener_);
}

std::string CutWire::ReadPdu(int socket) {
  std::string pdu(kPduHeaderBytes, '\0');
  if (!ReadWhole(socket, pdu.data(), pdu.size())) return "";
  uint32_t length = 0;
  for (size_t i = 2; i < kPduHeaderBytes; ++i) {
    length = length << 8 | static_cast<unsigned char>(pdu[i]);
  }
  pdu.resize(kPduHeaderBytes + length);
  if (!ReadWhole(socket, pdu.data() + kPduHeaderBytes, length)) return "";
  return pdu;
}

void CutWire::Run() {
  const int sender = accept(listener_, nullptr, nullptr);
  const int receiver = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in place = Loopback(target_);
  if (sender >= 0 &&
      connect(receiver, reinterpret_cast<const sockaddr*>(&place), sizeof(place)) == 0) {
    std::thread answers([receiver, sender] { PassBack(receiver, sender); });
    for (int64_t passed = 0; passed < bytes_;) {
      std::string pdu = ReadPdu(sender);
      if (pdu.empty()) break;
      passed += static_cast<int64_t>(pdu.size());
      const bool cut = passed >= bytes_ && end_ == WireEnd::kClosed;
      WriteAll(receiver, pdu.data(), cut ? pdu.size() / 2 : pdu.size());
    }
    if (end_ == WireEnd::kAborted) WriteAll(receiver, kAbort.data(), kAbort.size());
    shutdown(receiver, end_ == WireEnd::kClosed ? SHUT_RDWR : SHUT_WR);
    answers.join();
  }
  if (sender >= 0) close(sender);
  close(receiver);
}

}  // namespace tissueform::testing
