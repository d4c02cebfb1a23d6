// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/call_scope.h"

#include "spdlog/spdlog.h"

#include "server/rpc/status_conversion.h"

namespace tissueform {

bool ServiceGate::WaitUntilIdle(std::chrono::steady_clock::time_point deadline) {
  MutexLock lock(mutex_);
  while (open_calls_ > 0) {
    if (!idle_.WaitUntil(mutex_, deadline)) {
      return open_calls_ == 0;
    }
  }
  return true;
}

void ServiceGate::Enter() {
  MutexLock lock(mutex_);
  ++open_calls_;
}

void ServiceGate::Leave() {
  MutexLock lock(mutex_);
  if (--open_calls_ == 0) {
    idle_.NotifyAll();
  }
}

CallScope::CallScope(std::string_view method, CallKind kind, ServiceGate* gate)
    : method_(method), gate_(gate), start_(std::chrono::steady_clock::now()) {
  gate_->Enter();
  if (kind == CallKind::kNewWork && gate_->draining()) {
    admission_ = absl::UnavailableError(
        "the server is draining and takes no new work; try another one, or again in a minute");
  }
}

grpc::Status CallScope::End(const absl::Status& outcome) const {
  const std::chrono::duration<double, std::milli> elapsed =
      std::chrono::steady_clock::now() - start_;
  const auto level = outcome.ok() || outcome.code() == absl::StatusCode::kCancelled
                         ? spdlog::level::debug
                         : spdlog::level::info;
  spdlog::log(level, "{} {} {:.1f} ms", method_, absl::StatusCodeToString(outcome.code()),
              elapsed.count());
  gate_->Leave();
  return ToGrpcStatus(outcome);
}

}  // namespace tissueform
