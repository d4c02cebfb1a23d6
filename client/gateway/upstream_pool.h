// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "grpcpp/channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/security/credentials.h"

#include "client/gateway/gateway_limits.h"
#include "client/gateway/upstream_health.h"
#include "core/base/mutex.h"

namespace tissueform {

// A connection to the server, and how many calls are open on it. A server takes 128 at a time on
// one and lets more wait at the client: so a call has a place here before it is made.
struct UpstreamChannel {
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<grpc::GenericStub> stub;
  int calls = 0;  // of the pool
};

class UpstreamPool;

// The place of one call; given back by its destructor. The pool outlives it.
class CallSlot {
 public:
  CallSlot(UpstreamPool* pool, UpstreamChannel* channel) : pool_(pool), channel_(channel) {}
  CallSlot(CallSlot&& other) noexcept : pool_(other.pool_), channel_(other.channel_) {
    other.pool_ = nullptr;
  }
  CallSlot& operator=(CallSlot&&) = delete;
  ~CallSlot();

  grpc::GenericStub& stub() const { return *channel_->stub; }

 private:
  UpstreamPool* pool_;
  UpstreamChannel* channel_;
};

// The connections to the server behind the gateway, or to the HAProxy before several. Thread-safe.
class UpstreamPool {
 public:
  UpstreamPool(
      std::string address, const GatewayLimits& limits,
      std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials());

  // Error: ResourceExhausted, when all connections carry as many calls as they may.
  absl::StatusOr<CallSlot> Take();

  // Whether calls are served.
  bool IsReady() const { return health_.IsServing(); }

 private:
  friend class CallSlot;

  // Constant.
  const std::string address_;
  const GatewayLimits limits_;
  const std::shared_ptr<grpc::ChannelCredentials> credentials_;

  // Self-synchronised.
  UpstreamHealth health_;

  mutable Mutex mutex_;
  // Made when they are needed.
  std::vector<std::unique_ptr<UpstreamChannel>> channels_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
