// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/gateway/raw_client.h"

#include <array>
#include <cstring>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform::testing {
namespace {

constexpr timeval kPatience = {60, 0};

void SetBigEndian(uint64_t number, size_t bytes, std::string* text) {
  for (size_t i = bytes; i-- > 0;) text->push_back(static_cast<char>(number >> 8 * i));
}

uint64_t BigEndian(const std::string& text) {
  uint64_t number = 0;
  for (const char c : text) number = number << 8 | static_cast<uint8_t>(c);
  return number;
}

}  // namespace

RawClient::RawClient(int port) : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof(kPatience));
  setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof(kPatience));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  static_cast<void>(connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)));
}

RawClient::~RawClient() { close(fd_); }

bool RawClient::Send(absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

void RawClient::HalfClose() { shutdown(fd_, SHUT_WR); }

bool RawClient::Fill() {
  std::array<char, 65536> buffer{};
  const ssize_t count = recv(fd_, buffer.data(), buffer.size(), 0);
  if (count > 0) read_.append(buffer.data(), static_cast<size_t>(count));
  return count > 0;
}

std::string RawClient::Read(size_t bytes) {
  while (read_.size() < bytes && Fill()) {
  }
  std::string text = read_.substr(0, bytes);
  read_.erase(0, text.size());
  return text;
}

std::string RawClient::ReadUntil(absl::string_view end) {
  size_t found = std::string::npos;
  do {
    if (!end.empty()) found = read_.find(std::string(end));
  } while (found == std::string::npos && Fill());
  const size_t size = found == std::string::npos ? read_.size() : found + end.size();
  std::string text = read_.substr(0, size);
  read_.erase(0, size);
  return text;
}

std::string Ask(int port, const std::string& line, const std::string& fields,
                const std::string& body) {
  RawClient client(port);
  client.Send(
      absl::StrCat(line, "\r\nhost: localhost\r\nconnection: close\r\n", fields, "\r\n", body));
  return client.ReadAll();
}

int StatusOf(const std::string& reply) {
  int status = 0;
  if (reply.size() < 12 || !absl::SimpleAtoi(reply.substr(9, 3), &status)) return 0;
  return status;
}

std::string AskWeb(int port, const std::string& method, const std::string& body,
                   const std::string& fields) {
  return Ask(port, absl::StrCat("POST ", method, " HTTP/1.1"),
             absl::StrCat("content-type: application/grpc-web+proto\r\ncontent-length: ",
                          body.size(), "\r\n", fields),
             body);
}

std::string WebBody(const std::string& message) {
  std::string body(1, '\0');
  SetBigEndian(message.size(), 4, &body);
  return body + message;
}

RawSocket::RawSocket(int port, const std::string& fields) : raw_(port) {
  raw_.Send(absl::StrCat(
      "GET /call HTTP/1.1\r\nhost: localhost\r\nconnection: upgrade\r\nupgrade: websocket\r\n"
      "sec-websocket-version: 13\r\nsec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
      fields, "\r\n"));
  answer_ = raw_.ReadUntil("\r\n\r\n");
}

bool RawSocket::SendFrame(uint8_t first_byte, const std::string& payload) {
  constexpr uint8_t kMasked = 0x80;
  std::string frame(1, static_cast<char>(first_byte));
  if (payload.size() < 126) {
    frame.push_back(static_cast<char>(kMasked | payload.size()));
  } else if (payload.size() < 65536) {
    frame.push_back(static_cast<char>(kMasked | 126));
    SetBigEndian(payload.size(), 2, &frame);
  } else {
    frame.push_back(static_cast<char>(kMasked | 127));
    SetBigEndian(payload.size(), 8, &frame);
  }
  frame.append(4, '\0');  // a mask that changes nothing
  return raw_.Send(frame + payload);
}

bool RawSocket::SendOurs(SocketFrameKind kind, const std::string& payload) {
  return SendBinary(OurFrame(kind, payload));
}

bool RawSocket::Start(const std::string& method) {
  v1::GatewayCallStart start;
  start.set_method(method);
  return SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
}

RawSocket::Message RawSocket::Receive() {
  while (true) {
    const std::string head = raw_.Read(2);
    if (head.size() < 2) return {};
    const auto length = static_cast<uint8_t>(head[1]);
    const uint64_t size = length == 126   ? BigEndian(raw_.Read(2))
                          : length == 127 ? BigEndian(raw_.Read(8))
                                          : length;
    Message message = {.opcode = head[0] & 0x0f, .payload = raw_.Read(size)};
    if (message.opcode != kPing) return message;
  }
}

v1::GatewayCallEnd RawSocket::ReceiveEnd() {
  v1::GatewayCallEnd end;
  end.set_code(-1);  // none came
  while (true) {
    const Message message = Receive();
    if (message.opcode != kBinary || message.payload.size() < kSocketFrameHeadBytes) return end;
    if (message.payload[1] != static_cast<char>(SocketFrameKind::kEnd)) continue;
    end.ParseFromString(message.payload.substr(kSocketFrameHeadBytes));
    return end;
  }
}

int RawSocket::ReceiveClose() {
  while (true) {
    const Message message = Receive();
    if (message.opcode == 0) return 0;
    if (message.opcode == kCloseCode)
      return static_cast<int>(BigEndian(message.payload.substr(0, 2)));
  }
}

std::string OurFrame(SocketFrameKind kind, const std::string& payload) {
  std::string frame(kSocketFrameHeadBytes, '\0');
  frame[0] = 1;
  frame[1] = static_cast<char>(kind);
  frame[2] = static_cast<char>(kSocketFrameHeadBytes);
  const auto size = static_cast<uint32_t>(payload.size());
  std::memcpy(&frame[4], &size, sizeof(size));
  return frame + payload;
}

}  // namespace tissueform::testing
