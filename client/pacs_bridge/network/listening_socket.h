// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

// A socket that waits for connections, and a way to stop waiting.
class ListeningSocket {
 public:
  struct Connection {
    int socket = -1;           // the taker's to close
    std::string address = {};  // without the port
  };

  // Port 0: a free one. Errors: InvalidArgument (no IPv4 address), Unavailable (taken).
  static absl::StatusOr<ListeningSocket> Listen(const std::string& address, int port);
  ~ListeningSocket();
  ListeningSocket(ListeningSocket&& other) noexcept;
  ListeningSocket& operator=(ListeningSocket&&) = delete;

  int port() const { return port_; }

  // Waits for a connection. Nothing: Wake was called, or there are no descriptors at the moment.
  std::optional<Connection> Accept();
  // From any thread, until it is closed: Accept returns, now and every time.
  void Wake();
  // Refuses connections that still wait. REQUIRES: no thread is in Accept or Wake, now or later.
  void Close();

 private:
  ListeningSocket(int socket, int wake, int port) : socket_(socket), wake_(wake), port_(port) {}

  int socket_;
  int wake_;
  const int port_;
};

}  // namespace tissueform
