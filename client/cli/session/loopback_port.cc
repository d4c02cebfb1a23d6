// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/loopback_port.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform {
namespace {

// 0, or the system's error. Binds as servers do: a port whose last connections still close is free.
int TryToListen(int fd, int port) {
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  const bool listens =
      bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
      listen(fd, 1) == 0;
  return listens ? 0 : errno;
}

}  // namespace

absl::Status CheckLoopbackPort(int port, const std::string& option) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return absl::ErrnoToStatus(errno, "cannot create a socket");
  const int error = TryToListen(fd, port);
  close(fd);
  if (error == 0) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(option, " ", port, ": cannot listen on 127.0.0.1:", port, ": ",
                   std::strerror(error), "; use another port, or 0 for a free one"));
}

}  // namespace tissueform
