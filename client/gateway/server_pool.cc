// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/server_pool.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/support/channel_arguments.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// A machine that is gone is noticed within 20 s; servers allow a ping every 10 s.
constexpr int kKeepaliveMilliseconds = 12'000;
constexpr int kKeepaliveTimeoutMilliseconds = 8'000;
// A server that was started again is found soon.
constexpr int kFirstBackoffMilliseconds = 100;
constexpr int kLastBackoffMilliseconds = 1000;

grpc::ChannelArguments Arguments(const GatewayLimits& limits) {
  grpc::ChannelArguments arguments;
  // Otherwise all channels to an address share one connection.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMilliseconds);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kFirstBackoffMilliseconds);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLastBackoffMilliseconds);
  arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
  arguments.SetMaxReceiveMessageSize(static_cast<int>(limits.answer_bytes));
  return arguments;
}

std::vector<std::shared_ptr<grpc::Channel>> ConnectForHealth(
    const std::vector<NodeAddress>& servers, const GatewayLimits& limits,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  grpc::ChannelArguments arguments = Arguments(limits);
  arguments.SetServiceConfigJSON(ServerHealth::HealthServiceConfig());
  std::vector<std::shared_ptr<grpc::Channel>> channels;
  channels.reserve(servers.size());
  for (const NodeAddress& server : servers) {
    channels.push_back(grpc::CreateCustomChannel(server.address, credentials, arguments));
  }
  return channels;
}

}  // namespace

CallSlot::~CallSlot() {
  if (pool_ == nullptr) return;
  MutexLock lock(pool_->mutex_);
  --channel_->calls;
}

ServerPool::ServerPool(const std::vector<NodeAddress>& servers, const GatewayLimits& limits,
                       std::shared_ptr<grpc::ChannelCredentials> credentials)
    : limits_(limits),
      credentials_(std::move(credentials)),
      choice_(servers),
      health_(ConnectForHealth(servers, limits, credentials_)) {
  channels_.resize(servers.size());
}

absl::StatusOr<CallSlot> ServerPool::Take(absl::string_view session, absl::string_view node) {
  TF_ASSIGN_OR_RETURN(const size_t server, choice_.Choose(session, node, [this](size_t place) {
    return health_.IsServing(place);
  }));
  MutexLock lock(mutex_);
  auto& channels = channels_[server];
  for (auto& channel : channels) {
    if (channel->calls >= limits_.calls_per_channel) continue;
    ++channel->calls;
    return CallSlot(this, channel.get());
  }
  if (static_cast<int>(channels.size()) >= limits_.channels_per_server) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the gateway has ", limits_.calls_per_channel * limits_.channels_per_server,
                     " open calls to this server, which is the limit; try again in a moment"));
  }
  auto channel = std::make_unique<ServerChannel>();
  channel->channel = grpc::CreateCustomChannel(choice_.servers()[server].address, credentials_,
                                               Arguments(limits_));
  channel->stub = std::make_unique<grpc::GenericStub>(channel->channel);
  channel->calls = 1;
  channels.push_back(std::move(channel));
  return CallSlot(this, channels.back().get());
}

bool ServerPool::IsReady() const {
  for (size_t i = 0; i < choice_.servers().size(); ++i) {
    if (health_.IsServing(i)) return true;
  }
  return false;
}

}  // namespace tissueform
