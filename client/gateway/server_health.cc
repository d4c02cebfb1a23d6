// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/server_health.h"

#include <chrono>
#include <cstdint>
#include <utility>

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kInterval{250};

}  // namespace

const char* ServerHealth::HealthServiceConfig() {
  return R"({"healthCheckConfig": {"serviceName": ""},
             "loadBalancingConfig": [{"round_robin": {}}]})";
}

ServerHealth::ServerHealth(std::vector<std::shared_ptr<grpc::Channel>> channels)
    : channels_(std::move(channels)), serving_(channels_.size()) {
  thread_ = std::thread([this] { Follow(); });
}

ServerHealth::~ServerHealth() {
  ends_ = true;
  thread_.join();
}

// The thread is needed beside the notices, too: a channel that no call uses connects and reads only
// while somebody waits on a queue.
void ServerHealth::Follow() {
  const auto watch = [this](size_t i) {
    const grpc_connectivity_state state = channels_[i]->GetState(/*try_to_connect=*/true);
    serving_[i] = state == GRPC_CHANNEL_READY;
    channels_[i]->NotifyOnStateChange(state, std::chrono::system_clock::now() + kInterval, &queue_,
                                      reinterpret_cast<void*>(i));
  };
  for (size_t i = 0; i < channels_.size(); ++i) watch(i);
  void* tag = nullptr;
  bool changed = false;
  for (size_t open = channels_.size(); open > 0 && queue_.Next(&tag, &changed);) {
    if (ends_) {
      --open;
    } else {
      watch(reinterpret_cast<size_t>(tag));
    }
  }
  queue_.Shutdown();
  while (queue_.Next(&tag, &changed)) {
  }
}

}  // namespace tissueform
