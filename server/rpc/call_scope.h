// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <string_view>

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

#include "core/base/mutex.h"

namespace tissueform {

// Whether the server takes new work, and how many calls are open. Thread-safe.
class ServiceGate {
 public:
  void StartDraining() { draining_ = true; }
  bool draining() const { return draining_; }

  // Blocks until no call is open. False when some still are at the deadline.
  bool WaitUntilIdle(std::chrono::steady_clock::time_point deadline);

 private:
  friend class CallScope;

  void Enter();
  void Leave();

  std::atomic<bool> draining_ = false;

  Mutex mutex_;
  ConditionVariable idle_;
  int open_calls_ ABSL_GUARDED_BY(mutex_) = 0;
};

// What a call asks for.
enum class CallKind {
  kNewWork,  // refused while the server drains
  kUpkeep,   // looks or tidies up: always welcome
};

// The common beginning and end of every rpc: made first, asked for its admission, ended once with
// the outcome. Copies stand for the same call. The place where a caller is authenticated.
//
// Logs method, code and duration, and nothing that came from the client: names and messages may
// identify a patient. One thread at a time.
class CallScope {
 public:
  // `method` ("MeshService.GetMesh") must outlive the scope.
  // `gate` must outlive it too.
  CallScope(std::string_view method, CallKind kind, ServiceGate* gate);

  // OK, or why the call is not served: Unavailable.
  const absl::Status& admission() const { return admission_; }

  // What the rpc is finished with. Call it once.
  grpc::Status End(const absl::Status& outcome) const;

 private:
  std::string_view method_;
  ServiceGate* gate_;
  std::chrono::steady_clock::time_point start_;
  absl::Status admission_;
};

}  // namespace tissueform
