// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstddef>

namespace tissueform {

// What a browser, or a client that pretends to be one, may use of a gateway. docs/gateway.md lists
// all limits.
struct GatewayLimits {
  // Of a request's line and header fields.
  size_t header_bytes = size_t{16} << 10;
  // Of a message of a client, over gRPC-Web (whose frame has 5 bytes more) and over a WebSocket.
  size_t message_bytes = size_t{4} << 20;
  // Of a message of a server.
  size_t answer_bytes = size_t{64} << 20;
  // Connections at the same time; what is more is closed at once.
  int connections = 4096;
  int connections_per_address = 2048;
  // Of these WebSockets; what is more is answered with 503.
  int sockets = 2048;
  // Calls at the same time on one connection to the server, which takes 128 (HAProxy: 100), and
  // such connections.
  int calls_per_channel = 100;
  int channels_per_server = 24;
  // A request's header, from its first byte; its body; the start of a socket.
  std::chrono::seconds header_deadline{10};
  std::chrono::seconds body_deadline{60};
  std::chrono::seconds start_deadline{10};
  // A connection that asks for nothing.
  std::chrono::seconds idle_deadline{75};
  // A client that takes nothing of what waits for it, a server that takes nothing of a client, a
  // client that does not answer pings.
  std::chrono::seconds stall_deadline{30};
  // After SIGTERM, for clients to take their last frames.
  std::chrono::seconds drain_deadline{5};
};

}  // namespace tissueform
