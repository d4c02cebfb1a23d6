// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/upstream_health.h"

#include <chrono>

#include "grpcpp/completion_queue.h"

namespace tissueform {
namespace {

using grpc::health::v1::HealthCheckResponse;

constexpr std::chrono::milliseconds kInterval{250};
constexpr std::chrono::seconds kDeadline{2};

}  // namespace

UpstreamHealth::UpstreamHealth(const std::shared_ptr<grpc::Channel>& channel) : stub_(channel) {
  thread_ = std::thread([this] { Follow(); });
}

UpstreamHealth::~UpstreamHealth() {
  {
    MutexLock lock(mutex_);
    ends_ = true;
    if (asking_ != nullptr) asking_->TryCancel();
    ending_.NotifyAll();
  }
  thread_.join();
}

void UpstreamHealth::Follow() {
  for (;;) {
    grpc::ClientContext context;
    if (!Begin(&context)) return;
    serving_ = Ask(&context);
    Rest();
  }
}

bool UpstreamHealth::Begin(grpc::ClientContext* context) {
  MutexLock lock(mutex_);
  if (ends_) return false;
  asking_ = context;
  return true;
}

bool UpstreamHealth::Ask(grpc::ClientContext* context) {
  context->set_deadline(std::chrono::system_clock::now() + kDeadline);
  grpc::CompletionQueue queue;
  const auto call = stub_.PrepareUnaryCall(context, "/grpc.health.v1.Health/Check", {}, &queue);
  call->StartCall();
  HealthCheckResponse answer;
  grpc::Status status;
  call->Finish(&answer, &status, this);
  void* tag = nullptr;
  bool done = false;
  queue.Next(&tag, &done);
  return status.ok() && answer.status() == HealthCheckResponse::SERVING;
}

void UpstreamHealth::Rest() {
  const auto next = std::chrono::steady_clock::now() + kInterval;
  MutexLock lock(mutex_);
  asking_ = nullptr;
  while (!ends_ && ending_.WaitUntil(mutex_, next)) {
  }
}

}  // namespace tissueform
