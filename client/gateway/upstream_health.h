// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "grpc/health/v1/health.pb.h"
#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/impl/codegen/proto_utils.h"

#include "core/base/mutex.h"

namespace tissueform {

// Whether calls are served, asked of gRPC's health service several times a second. Every question
// is a call of its own (Check, not Watch): HAProxy gives it to a server that is up, so that one
// server that drains does not speak for the others. Thread-safe.
class UpstreamHealth {
 public:
  explicit UpstreamHealth(const std::shared_ptr<grpc::Channel>& channel);
  // Cancels the question that is open.
  ~UpstreamHealth();

  // By the last answer; at first false.
  bool IsServing() const { return serving_; }

 private:
  using Stub = grpc::TemplatedGenericStub<grpc::health::v1::HealthCheckRequest,
                                          grpc::health::v1::HealthCheckResponse>;

  void Follow();
  // False when it ends.
  bool Begin(grpc::ClientContext* context);
  bool Ask(grpc::ClientContext* context);
  void Rest();

  // Self-synchronised.
  Stub stub_;
  std::atomic<bool> serving_ = false;

  Mutex mutex_;
  ConditionVariable ending_;
  bool ends_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::ClientContext* asking_ ABSL_GUARDED_BY(mutex_) = nullptr;
  std::thread thread_;
};

}  // namespace tissueform
