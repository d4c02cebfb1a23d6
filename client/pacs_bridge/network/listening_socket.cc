// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/listening_socket.h"

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <poll.h>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

namespace tissueform {
namespace {

constexpr int kBacklog = 64;
// When all descriptors are in use a connection stays in the backlog; it is tried again after this.
constexpr int kPauseMilliseconds = 100;

absl::Status SystemSaysOf(absl::string_view what, const std::string& address, int port) {
  return absl::UnavailableError(absl::StrCat("cannot ", what, " at ", address, ":", port, ": ",
                                             std::strerror(errno), "; choose another --listen"));
}

}  // namespace

absl::StatusOr<ListeningSocket> ListeningSocket::Listen(const std::string& address, int port) {
  sockaddr_in place = {};
  place.sin_family = AF_INET;
  place.sin_port = htons(static_cast<uint16_t>(port));
  if (port < 0 || port > 65535 || inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(address, ":", port, " is not an IPv4 address and port"));
  }
  ListeningSocket listening(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0),
                            eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), port);
  const int on = 1;
  setsockopt(listening.socket_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  if (listening.wake_ < 0 ||
      bind(listening.socket_, reinterpret_cast<sockaddr*>(&place), sizeof(place)) != 0 ||
      listen(listening.socket_, kBacklog) != 0) {
    return SystemSaysOf("listen", address, port);
  }
  socklen_t size = sizeof(place);
  getsockname(listening.socket_, reinterpret_cast<sockaddr*>(&place), &size);
  return ListeningSocket(std::exchange(listening.socket_, -1), std::exchange(listening.wake_, -1),
                         ntohs(place.sin_port));
}

ListeningSocket::ListeningSocket(ListeningSocket&& other) noexcept
    : socket_(std::exchange(other.socket_, -1)),
      wake_(std::exchange(other.wake_, -1)),
      port_(other.port_) {}

ListeningSocket::~ListeningSocket() { Close(); }

void ListeningSocket::Close() {
  if (socket_ >= 0) close(std::exchange(socket_, -1));
  if (wake_ >= 0) close(std::exchange(wake_, -1));
}

std::optional<ListeningSocket::Connection> ListeningSocket::Accept() {
  std::array<pollfd, 2> waiting = {pollfd{socket_, POLLIN, 0}, pollfd{wake_, POLLIN, 0}};
  while (true) {
    if (poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) return {};
    if (waiting[1].revents != 0) return {};
    sockaddr_in peer = {};
    socklen_t size = sizeof(peer);
    const int taken = accept4(socket_, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_CLOEXEC);
    if (taken < 0) {
      if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
        poll(&waiting[1], 1, kPauseMilliseconds);
        return {};
      }
      continue;
    }
    std::array<char, INET_ADDRSTRLEN> text = {};
    inet_ntop(AF_INET, &peer.sin_addr, text.data(), text.size());
    return Connection{taken, text.data()};
  }
}

void ListeningSocket::Wake() {
  if (wake_ < 0) return;  // closed
  const uint64_t one = 1;
  if (write(wake_, &one, sizeof(one)) < 0) return;  // it is full: woken already
}

}  // namespace tissueform
