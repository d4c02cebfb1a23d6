// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "grpcpp/channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/security/credentials.h"

#include "client/gateway/gateway_limits.h"
#include "client/gateway/server_choice.h"
#include "client/gateway/server_health.h"
#include "core/base/mutex.h"

namespace tissueform {

// A connection to a server, and how many calls are open on it. A server takes 128 at a time on one
// and lets more wait at the client: so a call has a place here before it is made.
struct ServerChannel {
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<grpc::GenericStub> stub;
  int calls = 0;  // of the pool
};

class ServerPool;

// The place of one call; given back by its destructor. The pool outlives it.
class CallSlot {
 public:
  CallSlot(ServerPool* pool, ServerChannel* channel) : pool_(pool), channel_(channel) {}
  CallSlot(CallSlot&& other) noexcept : pool_(other.pool_), channel_(other.channel_) {
    other.pool_ = nullptr;
  }
  CallSlot& operator=(CallSlot&&) = delete;
  ~CallSlot();

  grpc::GenericStub& stub() const { return *channel_->stub; }

 private:
  ServerPool* pool_;
  ServerChannel* channel_;
};

// The servers behind the gateway. Thread-safe.
class ServerPool {
 public:
  // At least one, as ServerChoice::Check has them.
  ServerPool(
      const std::vector<NodeAddress>& servers, const GatewayLimits& limits,
      std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials());

  // A place for a call, of the server that ServerChoice::Choose gives it; those serve that are
  // healthy.
  //
  // Errors: those of Choose; ResourceExhausted when all connections to that server carry as many
  // calls as they may.
  absl::StatusOr<CallSlot> Take(absl::string_view session, absl::string_view node);

  // Whether a server takes calls.
  bool IsReady() const;

 private:
  friend class CallSlot;

  // Constant.
  const GatewayLimits limits_;
  const std::shared_ptr<grpc::ChannelCredentials> credentials_;

  // Self-synchronised.
  ServerChoice choice_;
  ServerHealth health_;

  mutable Mutex mutex_;
  // Of each server; made when they are needed.
  std::vector<std::vector<std::unique_ptr<ServerChannel>>> channels_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
