// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/tcp_probe.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <netdb.h>
#include <poll.h>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"
#include <sys/socket.h>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

using Addresses = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;
using SteadyClock = std::chrono::steady_clock;

// The beginning of HTTP/2, and an empty frame of settings.
constexpr absl::string_view kPreface("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\4\0\0\0\0\0", 33);
constexpr size_t kMaxAddresses = 8;

// Null, with `error` set, if the host name does not resolve.
Addresses Resolve(const ServerEndpoint& endpoint, std::string* error) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int code = getaddrinfo(endpoint.host.c_str(), endpoint.port.c_str(), &hints, &found);
  if (code != 0) *error = gai_strerror(code);
  return {code == 0 ? found : nullptr, &freeaddrinfo};
}

std::string TextOf(const addrinfo& address) {
  std::array<char, NI_MAXHOST> text{};
  getnameinfo(address.ai_addr, address.ai_addrlen, text.data(), text.size(), nullptr, 0,
              NI_NUMERICHOST);
  return text.data();
}

// 0, or the error of the system.
int FinishConnecting(const ProbeSocket& socket, const addrinfo& address) {
  if (connect(socket.fd(), address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!socket.Wait(POLLOUT, SteadyClock::now() + kProbeDeadline)) return ETIMEDOUT;
  int error = 0;
  socklen_t size = sizeof(error);
  getsockopt(socket.fd(), SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

struct Connection {
  ProbeSocket socket{};
  std::string address = {};
  int error = EADDRNOTAVAIL;  // 0: connected
};

Connection ConnectToAny(const ServerEndpoint& endpoint) {
  std::string ignored;
  const Addresses addresses = Resolve(endpoint, &ignored);
  int error = EADDRNOTAVAIL;
  size_t tried = 0;
  for (const addrinfo* address = addresses.get(); address != nullptr && tried < kMaxAddresses;
       address = address->ai_next, ++tried) {
    ProbeSocket made(socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (made.fd() < 0) continue;
    error = FinishConnecting(made, *address);
    if (error == 0) {
      return {.socket = std::move(made), .address = TextOf(*address), .error = 0};
    }
  }
  return {.error = error};
}

std::string AdviceFor(int error, const ServerEndpoint& endpoint) {
  if (error == ECONNREFUSED) {
    return absl::StrCat("nothing listens on port ", endpoint.port,
                        ": is the server started, and is this its port?");
  }
  if (error == ETIMEDOUT) {
    return absl::StrCat("no reply: a firewall in between, or the wrong machine; TCP port ",
                        endpoint.port, " must be open");
  }
  return "this machine has no route to that address: check its network, or the VPN";
}

}  // namespace

ProbeSocket::~ProbeSocket() {
  if (fd_ >= 0) close(fd_);
}

bool ProbeSocket::Wait(short events, SteadyClock::time_point deadline) const {
  while (true) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - SteadyClock::now()).count();
    pollfd polled = {fd_, events, 0};
    const int ready = poll(&polled, 1, static_cast<int>(std::max<int64_t>(left, 0)));
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

absl::StatusOr<ServerEndpoint> ParseEndpoint(const std::string& address) {
  const size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  int port = 0;
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  const bool fine = colon != std::string::npos && !host.empty() &&
                    (bracketed || host.find(':') == std::string::npos) &&
                    absl::SimpleAtoi(address.substr(colon + 1), &port) && port > 0 && port <= 65535;
  if (!fine) {
    return absl::InvalidArgumentError(absl::StrCat(
        "\"", address, "\" is not a server address; use HOST:PORT, with IPv6 in brackets"));
  }
  if (bracketed) host = host.substr(1, host.size() - 2);
  return ServerEndpoint{.host = host, .port = absl::StrCat(port)};
}

DoctorLine CheckName(const ServerEndpoint& endpoint) {
  std::string error;
  const Addresses addresses = Resolve(endpoint, &error);
  if (addresses == nullptr) {
    return {.check = "name",
            .finding = Finding::kFailed,
            .text = absl::StrCat(endpoint.host, ": ", error),
            .advice = "check the spelling, this machine's DNS, or the VPN"};
  }
  std::vector<std::string> texts;
  for (const addrinfo* address = addresses.get();
       address != nullptr && texts.size() < kMaxAddresses; address = address->ai_next) {
    texts.push_back(TextOf(*address));
  }
  return {.check = "name", .text = absl::StrCat(endpoint.host, " is ", absl::StrJoin(texts, ", "))};
}

DoctorLine CheckRoute(const ServerEndpoint& endpoint) {
  const Stopwatch watch;
  const Connection connection = ConnectToAny(endpoint);
  if (connection.error != 0) {
    return {.check = "route",
            .finding = Finding::kFailed,
            .text = absl::StrCat("no connection: ", std::strerror(connection.error)),
            .advice = AdviceFor(connection.error, endpoint)};
  }
  return {.check = "route",
          .text = absl::StrFormat("%s answers on port %s in %.1f ms", connection.address,
                                  endpoint.port, watch.Seconds() * 1e3)};
}

absl::StatusOr<ProbeSocket> ConnectProbe(const ServerEndpoint& endpoint) {
  Connection connection = ConnectToAny(endpoint);
  if (connection.error != 0) {
    return absl::UnavailableError(absl::StrCat("no connection: ", std::strerror(connection.error)));
  }
  return std::move(connection.socket);
}

absl::StatusOr<std::string> AnswerToPlainHttp2(const ServerEndpoint& endpoint) {
  TF_ASSIGN_OR_RETURN(const ProbeSocket socket, ConnectProbe(endpoint));
  if (send(socket.fd(), kPreface.data(), kPreface.size(), MSG_NOSIGNAL) < 0 ||
      !socket.Wait(POLLIN, SteadyClock::now() + kProbeDeadline)) {
    return std::string();
  }
  std::array<char, 64> bytes{};
  const ssize_t size = recv(socket.fd(), bytes.data(), bytes.size(), 0);
  return std::string(bytes.data(), static_cast<size_t>(std::max<ssize_t>(size, 0)));
}

}  // namespace tissueform
