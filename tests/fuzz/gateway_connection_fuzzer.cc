// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <string>
#include <unistd.h>

#include "absl/strings/string_view.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "client/gateway/gateway.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

constexpr absl::string_view kHandshake =
    "GET /call HTTP/1.1\r\nhost: localhost\r\nconnection: upgrade\r\nupgrade: websocket\r\n"
    "sec-websocket-version: 13\r\nsec-websocket-key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    "sec-websocket-protocol: tissueform.v1\r\n\r\n";

// Before a server that is not there: every call ends with UNAVAILABLE.
Gateway& AloneGateway() {
  static Gateway* const gateway = [] {
    GatewayOptions options;
    options.server = "unix:/nonexistent/tissueform.sock";
    options.port = 0;
    options.limits.message_bytes = 4096;
    auto started = Gateway::Start(options);
    if (!started.ok()) std::abort();
    return started->release();
  }();
  return *gateway;
}

// What the gateway answers until it ends the connection.
std::string AnswerTo(absl::string_view bytes) {
  constexpr timeval kGatewayPatience = {30, 0};
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &kGatewayPatience, sizeof(kGatewayPatience));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(AloneGateway().port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) std::abort();
  while (!bytes.empty()) {
    const ssize_t sent = send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) break;  // it has had enough
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  shutdown(fd, SHUT_WR);
  std::string answer;
  std::array<char, 4096> buffer{};
  while (true) {
    const ssize_t count = recv(fd, buffer.data(), buffer.size(), 0);
    if (count < 0 && errno == EINTR) continue;       // libFuzzer's clock
    if (count < 0 && errno == EAGAIN) std::abort();  // it hangs
    if (count <= 0) break;
    answer.append(buffer.data(), static_cast<size_t>(count));
  }
  close(fd);
  return answer;
}

}  // namespace

void FuzzGatewayConnection(const uint8_t* data, size_t size) {
  if (size == 0) return;
  const bool is_socket = data[0] % 2 == 1;
  std::string bytes(is_socket ? kHandshake : "");
  bytes.append(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string answer = AnswerTo(bytes);
  if (!answer.empty() && answer.compare(0, 7, "HTTP/1.") != 0) std::abort();
  if (AnswerTo("GET /healthz HTTP/1.0\r\nhost: localhost\r\n\r\n").find(" 200 ") ==
      std::string::npos) {
    std::abort();
  }
}

}  // namespace tissueform::fuzz
