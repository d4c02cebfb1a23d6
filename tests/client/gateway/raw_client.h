// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

#include "client/gateway/socket_frames.h"
#include "tissueform/v1/gateway.pb.h"

namespace tissueform::testing {

// A connection to loopback that sends any bytes, valid or not. Gives up after a minute.
class RawClient {
 public:
  explicit RawClient(int port);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  // False when the other side takes no more.
  bool Send(absl::string_view bytes);
  // What may still be read.
  void HalfClose();
  // So many bytes; fewer at the end.
  std::string Read(size_t bytes);
  // Up to and with this; all when it does not come.
  std::string ReadUntil(absl::string_view end);
  // All that follows.
  std::string ReadAll() { return ReadUntil({}); }

 private:
  bool Fill();

  int fd_ = -1;
  std::string read_;
};

// The reply to one request on a connection of its own: "GET / HTTP/1.1". Adds Host and `connection:
// close`; `fields` end with line ends.
std::string Ask(int port, const std::string& line, const std::string& fields = "",
                const std::string& body = "");

// 200 of "HTTP/1.1 200 OK"; 0 when there is no reply.
int StatusOf(const std::string& reply);

// POST of gRPC-Web with this body.
std::string AskWeb(int port, const std::string& method, const std::string& body,
                   const std::string& fields = "");
// A body of one message.
std::string WebBody(const std::string& message);

// A WebSocket as RFC 6455 has it, and as it has not.
class RawSocket {
 public:
  static constexpr int kText = 1, kBinary = 2, kCloseCode = 8, kPing = 9;

  struct Message {
    int opcode = 0;
    std::string payload;
  };

  // Opens it, with these fields beside.
  explicit RawSocket(int port,
                     const std::string& fields = "sec-websocket-protocol: tissueform.v1\r\n");

  RawClient& raw() { return raw_; }
  // Of the answer to the request.
  int status() const { return StatusOf(answer_); }
  const std::string& answer() const { return answer_; }

  // One frame; `first_byte` is FIN and opcode.
  bool SendFrame(uint8_t first_byte, const std::string& payload);
  bool SendBinary(const std::string& payload) { return SendFrame(0x80 | kBinary, payload); }
  // A frame of ours.
  bool SendOurs(SocketFrameKind kind, const std::string& payload = "");
  bool Start(const std::string& method);

  // The next message that is no ping; opcode 0 when the connection ends.
  Message Receive();
  // The end frame, after what comes before it.
  v1::GatewayCallEnd ReceiveEnd();
  // The code with which it is closed; 0 when the connection just ends.
  int ReceiveClose();

 private:
  RawClient raw_;
  std::string answer_;
};

// A frame of a client.
std::string OurFrame(SocketFrameKind kind, const std::string& payload);

}  // namespace tissueform::testing
