// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "google/protobuf/descriptor.h"

#include "client/gateway/gateway_counters.h"
#include "client/gateway/http_server.h"
#include "client/gateway/socket_frames.h"
#include "client/gateway/upstream_call.h"
#include "client/gateway/upstream_pool.h"

namespace tissueform {

// One call over a WebSocket. One message is on its way in each direction, and one more of the
// client's waits here: a client that is slow, or a server, slows the other and fills nothing.
class SocketCall final : public SocketUser,
                         public UpstreamUser,
                         public std::enable_shared_from_this<SocketCall> {
 public:
  // `client_address`: the address that the server receives. `pool` and `counters` outlive it.
  SocketCall(std::shared_ptr<Socket> socket, std::string client_address, UpstreamPool* pool,
             GatewayCounters* counters)
      : socket_(std::move(socket)),
        client_address_(std::move(client_address)),
        pool_(pool),
        counters_(counters) {}

  void OnOpen() override;
  void OnMessage(std::string message) override;
  void OnBadMessage(SocketClose why) override;
  void OnSilence() override;
  void OnSecond() override;
  void OnSent() override;
  void OnGone() override;
  void OnDrain() override;
  void OnBegun(std::map<std::string, std::string> headers) override;
  void OnAnswer(const grpc::ByteBuffer& message) override;
  void OnWritten() override;
  void OnEnd(CallEnd end) override;

 private:
  void OnFrame(const SocketFrame& frame, std::string* message);
  void Start(absl::string_view payload);
  // A frame of the server's to the client, or to wait behind a heartbeat.
  void Send(std::string frame);
  void SendHeartbeat();
  // To the server, or to wait until it takes it.
  void Forward(std::string payload);
  // The client has done something wrong.
  void Fail(GatewayEvent event, const absl::Status& status, SocketClose close);
  // Cancels the call where it has not ended, sends the end and closes.
  void Finish(const CallEnd& end, SocketClose close);

  // Constant until the socket is gone.
  std::shared_ptr<Socket> socket_;
  const std::string client_address_;
  UpstreamPool* const pool_;
  GatewayCounters* const counters_;
  // The strand's.
  std::shared_ptr<UpstreamCall> upstream_;
  const google::protobuf::Descriptor* answer_type_ = nullptr;
  bool started_ = false;
  bool tells_begin_ = false;
  bool half_closed_ = false;
  bool writing_ = false;  // to the server
  std::optional<std::string> waiting_;
  bool sending_ = false;  // to the client
  bool sending_heartbeat_ = false;
  std::string behind_heartbeat_;
  bool wants_heartbeat_ = false;
  int quiet_seconds_ = 0;  // in which nothing was sent to the client
  bool finished_ = false;
  std::string end_frame_;
  SocketClose close_ = SocketClose::kNormal;
};

}  // namespace tissueform
