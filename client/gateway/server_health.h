// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "grpcpp/channel.h"
#include "grpcpp/completion_queue.h"

namespace tissueform {

// Which servers say SERVING by gRPC's health service, followed all the time. Thread-safe.
class ServerHealth {
 public:
  // Channels of their own, made with HealthServiceConfig: they are READY while their server says
  // SERVING.
  explicit ServerHealth(std::vector<std::shared_ptr<grpc::Channel>> channels);
  // Takes up to kInterval.
  ~ServerHealth();

  // By the place in `channels`.
  bool IsServing(size_t server) const { return serving_[server]; }

  // What makes a channel ask for the health of its server.
  static const char* HealthServiceConfig();

 private:
  void Follow();

  // Constant.
  const std::vector<std::shared_ptr<grpc::Channel>> channels_;

  // Self-synchronised.
  std::vector<std::atomic<bool>> serving_;
  std::atomic<bool> ends_ = false;
  grpc::CompletionQueue queue_;
  std::thread thread_;
};

}  // namespace tissueform
