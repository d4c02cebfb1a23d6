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

#include "core/base/mutex.h"
#include "server/gateway/gateway_limits.h"
#include "server/gateway/server_health.h"

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
  // `addresses` as gRPC has them: "host:port", "unix:/path". At least one.
  ServerPool(
      const std::vector<std::string>& addresses, const GatewayLimits& limits,
      std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials());

  // A place for a call. One that names a session goes to the same server of those that are healthy,
  // whichever gateway is asked (rendezvous hashing); one that names none (empty) to the first of
  // them. Where none is, it is sent all the same, and the server's own answer counts.
  //
  // Errors: ResourceExhausted when all connections to that server carry as many calls as they may.
  absl::StatusOr<CallSlot> Take(absl::string_view session);

  // Whether a server takes calls.
  bool IsReady() const;

 private:
  friend class CallSlot;

  // A server's place among the addresses.
  size_t Choose(absl::string_view session) const;

  // Constant.
  const GatewayLimits limits_;
  const std::vector<std::string> addresses_;
  const std::shared_ptr<grpc::ChannelCredentials> credentials_;

  // Self-synchronised.
  ServerHealth health_;

  mutable Mutex mutex_;
  // Of each server; made when they are needed.
  std::vector<std::vector<std::unique_ptr<ServerChannel>>> channels_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
