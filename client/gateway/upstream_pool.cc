// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/upstream_pool.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/support/channel_arguments.h"

namespace tissueform {
namespace {

// A machine that is gone is noticed within 20 s; servers allow a ping every 10 s.
constexpr int kKeepaliveMilliseconds = 12'000;
constexpr int kKeepaliveTimeoutMilliseconds = 8'000;
// A server or HAProxy that was started again is found soon.
constexpr int kFirstBackoffMilliseconds = 100;
constexpr int kLastBackoffMilliseconds = 500;

std::shared_ptr<grpc::Channel> Connect(
    const std::string& address, const GatewayLimits& limits,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  grpc::ChannelArguments arguments;
  // Otherwise all channels to an address share one connection.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMilliseconds);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstBackoffMilliseconds);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLastBackoffMilliseconds);
  arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
  arguments.SetMaxReceiveMessageSize(static_cast<int>(limits.answer_bytes));
  return grpc::CreateCustomChannel(address, credentials, arguments);
}

}  // namespace

CallSlot::~CallSlot() {
  if (pool_ == nullptr) return;
  MutexLock lock(pool_->mutex_);
  --channel_->calls;
}

UpstreamPool::UpstreamPool(std::string address, const GatewayLimits& limits,
                           std::shared_ptr<grpc::ChannelCredentials> credentials)
    : address_(std::move(address)),
      limits_(limits),
      credentials_(std::move(credentials)),
      health_(Connect(address_, limits_, credentials_)) {}

absl::StatusOr<CallSlot> UpstreamPool::Take() {
  MutexLock lock(mutex_);
  for (auto& channel : channels_) {
    if (channel->calls >= limits_.calls_per_channel) continue;
    ++channel->calls;
    return CallSlot(this, channel.get());
  }
  if (static_cast<int>(channels_.size()) >= limits_.channels_per_server) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the gateway has ", limits_.calls_per_channel * limits_.channels_per_server,
                     " open calls to its server, which is the limit; try again in a moment"));
  }
  auto channel = std::make_unique<UpstreamChannel>();
  channel->channel = Connect(address_, limits_, credentials_);
  channel->stub = std::make_unique<grpc::GenericStub>(channel->channel);
  channel->calls = 1;
  channels_.push_back(std::move(channel));
  return CallSlot(this, channels_.back().get());
}

}  // namespace tissueform
