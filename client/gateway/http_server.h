// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/gateway/gateway_counters.h"
#include "client/gateway/gateway_limits.h"
#include "client/gateway/http_message.h"

// HTTP/1.1 and WebSockets. Boost.Beast does it, in http_server.cc alone.
//
// Every connection has a strand: what is said here of a connection is called on it, and what it
// offers may be called on it only, Post apart. Nothing here waits.
namespace tissueform {

// What a connection lets others do with it.
class ConnectionStrand {
 public:
  virtual ~ConnectionStrand() = default;
  // Any thread. Runs `job` on the strand, later.
  virtual void Post(std::function<void()> job) = 0;
};

// A reply that is sent in pieces.
class ReplyStream : public ConnectionStrand {
 public:
  // Once, before the first piece: what the reply begins with; its body is not looked at.
  virtual void Begin(const HttpReply& head) = 0;
  // The next piece, and whether it is the last one. One at a time: OnSent follows, except of the
  // last.
  virtual void Send(std::string piece, bool last) = 0;
};

// Who makes such a reply. After OnGone, or the last piece, nothing is called any more.
class ReplySource {
 public:
  virtual ~ReplySource() = default;
  virtual void OnSent() = 0;
  // The client is gone, or takes nothing.
  virtual void OnGone() = 0;
  // The gateway ends: the last piece shall come soon.
  virtual void OnDrain() = 0;
};

// How a WebSocket is closed.
enum class SocketClose : uint16_t {
  kNormal = 1000,
  kGoingAway = 1001,
  kProtocolError = 1002,
  kText = 1003,
  kTooLarge = 1009,
};

class Socket : public ConnectionStrand {
 public:
  // Asks for one message: OnMessage, OnBadMessage or OnGone follow.
  virtual void Receive() = 0;
  // A binary message. One at a time: OnSent follows.
  virtual void Send(std::string message) = 0;
  // Once, when nothing is being sent; nothing but OnGone follows.
  virtual void Close(SocketClose code) = 0;
};

// Who speaks over it. OnGone is the last that is called, once, also after Close.
class SocketUser {
 public:
  virtual ~SocketUser() = default;
  virtual void OnOpen() = 0;
  virtual void OnMessage(std::string message) = 0;
  // Text, or a message over the limit (Receive no more).
  virtual void OnBadMessage(SocketClose why) = 0;
  // No message has come in time since the socket was opened.
  virtual void OnSilence() = 0;
  // Once a second while the socket is open.
  virtual void OnSecond() = 0;
  virtual void OnSent() = 0;
  virtual void OnGone() = 0;
  // The gateway ends.
  virtual void OnDrain() = 0;
};

// What is to be done with a request, as its head says.
struct HttpDecision {
  enum Kind {
    kReply,   // with `reply`; a body is not read
    kStream,  // read the body, then Stream
    kSocket,  // become a WebSocket of the subprotocol tissueform.v1, then OpenSocket
  };
  Kind kind = kReply;
  HttpReply reply = {};
};

// What answers requests. Thread-safe.
class HttpHandler {
 public:
  virtual ~HttpHandler() = default;
  virtual HttpDecision Decide(const HttpHead& head) = 0;
  virtual std::shared_ptr<ReplySource> Stream(const HttpHead& head, std::string body,
                                              std::shared_ptr<ReplyStream> reply) = 0;
  virtual std::shared_ptr<SocketUser> OpenSocket(std::shared_ptr<Socket> socket,
                                                 const HttpHead& head) = 0;
  // A reply of the server itself (431, 413, 400), with the fields that all have.
  virtual HttpReply ReplyWith(int status) = 0;
};

class HttpServer {
 public:
  struct Options {
    std::string host = "127.0.0.1";
    int port = 8080;  // 0: any free one
    int threads = 2;
    GatewayLimits limits = {};
  };

  // Listens and answers when it returns. `handler` and `counters` must outlive the server.
  //
  // Errors: Unavailable, naming the address, when it cannot be listened on.
  static absl::StatusOr<std::unique_ptr<HttpServer>> Start(const Options& options,
                                                           HttpHandler* handler,
                                                           GatewayCounters* counters);
  virtual ~HttpServer() = default;

  virtual int port() const = 0;
  // Runs `job` on one of its threads, later.
  virtual void Post(std::function<void()> job) = 0;
  // Accepts nothing more, notifies all connections, waits for them up to the deadline of the
  // limits, closes those that are left and waits for what had been posted by then. Once.
  virtual void Drain() = 0;
};

}  // namespace tissueform
