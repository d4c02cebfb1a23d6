// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "client/gateway/gateway_counters.h"
#include "client/gateway/http_server.h"
#include "client/gateway/upstream_call.h"
#include "client/gateway/upstream_pool.h"

namespace tissueform {

// One call over gRPC-Web, from a request whose body has come. The next message is read from the
// server when the last one was taken by the client.
class WebCall final : public ReplySource,
                      public UpstreamUser,
                      public std::enable_shared_from_this<WebCall> {
 public:
  // `fields`: of every reply of the gateway. `client_address`: the address for the server.
  WebCall(std::shared_ptr<ReplyStream> reply, HttpFields fields, std::string client_address)
      : reply_(std::move(reply)),
        fields_(std::move(fields)),
        client_address_(std::move(client_address)) {}

  // Once. Makes the call, or reports to the client why not. `pool` outlives it.
  void Begin(const HttpHead& head, absl::string_view body, UpstreamPool* pool,
             GatewayCounters* counters);

  void OnSent() override;
  void OnGone() override;
  void OnDrain() override;
  void OnBegun(std::map<std::string, std::string> headers) override;
  void OnAnswer(const grpc::ByteBuffer& message) override;
  void OnWritten() override;
  void OnEnd(CallEnd end) override;

 private:
  absl::Status TryBegin(const HttpHead& head, absl::string_view body, UpstreamPool* pool,
                        GatewayCounters* counters);
  void SendEnd(CallEnd end);
  void BeginReply(const HttpFields& fields);
  // Lets go of both sides.
  void Done();

  std::shared_ptr<ReplyStream> reply_;
  const HttpFields fields_;
  const std::string client_address_;
  std::shared_ptr<UpstreamCall> upstream_;
  std::map<std::string, std::string> headers_;  // of the server
  bool begun_ = false;
  bool sending_ = false;
  std::optional<CallEnd> end_;  // to be sent after what is being sent
};

// As a call's end: code, message and reason.
CallEnd EndOf(const absl::Status& status);

}  // namespace tissueform
