// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"
#include "grpcpp/support/status.h"

#include "core/base/mutex.h"
#include "server/access/auth/authenticator.h"
#include "server/rpc/calls/call_observer.h"
#include "server/rpc/calls/call_quotas.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// The checks and observers of every call. All pointers may be null, and must outlive the
// calls.
struct CallChecks {
  Authenticator* authenticator = nullptr;  // null: all callers are anonymous
  // Whether an identified caller may call a method ("MeshService.GetMesh") at all; empty: yes.
  std::function<absl::Status(const Principal& caller, std::string_view method)> may_call = {};
  CallObserver* observer = nullptr;
  CallQuotas* quotas = nullptr;   // not for anonymous callers
  std::string gateway_name = {};  // see ClientAddress
  // The server's name in its cluster (kNodeHeader); empty without a cluster.
  std::string node_name = {};
};

// What every call passes first: the checks of its caller and its quotas, and whether the server
// takes new work. Also counts the open calls. Thread-safe.
class AdmissionControl {
 public:
  explicit AdmissionControl(CallChecks checks) : checks_(std::move(checks)) {}
  AdmissionControl() : AdmissionControl(CallChecks{}) {}

  const CallChecks& checks() const { return checks_; }

  void StartDraining() { draining_ = true; }
  bool draining() const { return draining_; }

  // Blocks until no call is open. False when some still are at the deadline.
  bool WaitUntilIdle(std::chrono::steady_clock::time_point deadline);

 private:
  friend class CallScope;

  void Enter();
  void Leave();

  const CallChecks checks_;
  std::atomic<bool> draining_ = false;

  Mutex mutex_;
  ConditionVariable idle_;
  int open_calls_ ABSL_GUARDED_BY(mutex_) = 0;
};

// The header in which a client may send an id of its own for a call, so that it finds the call in
// the server's log.
inline constexpr char kRequestIdHeader[] = "x-request-id";

// `from_client` where it is well formed (1 to 64 letters, digits, "-", "_" or "."), else a new one:
// what goes to the log must not carry anything else.
std::string RequestIdOr(std::string_view from_client);

// How often a call that lasts asks whether its caller is still good: what is revoked ends within a
// second.
inline constexpr std::chrono::milliseconds kReauthorizePeriod{500};

// The common beginning and end of every rpc: made first, asked for its admission, ended once with
// the outcome. It authenticates the caller and notifies the observers.
//
// Logs method, code, duration and request id, and nothing else that came from the client: names and
// messages may identify a patient. One thread at a time.
//
// In a cluster it says the server's name in initial and trailing metadata of every reply, and
// refuses a call that is meant for another server, before any other check.
class CallScope {
 public:
  // `method` ("MeshService.GetMesh") and `gate` must outlive the scope. `context` is read and given
  // metadata here and not kept; null where there is no network: a call without headers.
  CallScope(grpc::CallbackServerContext* context, std::string_view method, CallKind kind,
            AdmissionControl* gate);
  // A scope that was not ended: the call is over nevertheless, and the log says so.
  ~CallScope();
  CallScope(CallScope&& other) noexcept;
  CallScope& operator=(CallScope&&) = delete;

  // OK, or why the call is not served: Unavailable (WRONG_NODE, draining), Unauthenticated,
  // ResourceExhausted (a quota), or what the gate's may_call and the observer say.
  const absl::Status& admission() const { return admission_; }
  const Principal& principal() const { return *authenticated_.principal; }
  const Authenticated& authenticated() const { return authenticated_; }
  const std::string& request_id() const { return request_id_; }

  // The call relies on this token from now on. Errors: those of the authenticator;
  // Unauthenticated (the token belongs to another user). Does nothing without logins.
  absl::Status Renew(const std::string& token);
  // The same with the token of another call, if that has the same caller and expires later.
  void RenewFrom(const Authenticated& other);

  // For calls that last: whether this one may go on. Asked again every kReauthorizePeriod,
  // except without logins.
  bool may_end_early() const {
    return gate_ != nullptr && gate_->checks().authenticator != nullptr;
  }
  absl::Status IsStillAuthorized() const;
  // The same as a function that needs no scope any more.
  std::function<absl::Status()> AuthorizationQuestion() const;

  // Says what the call is about ("sessions/{id}"), once it is known that its caller may use it.
  void SetResource(std::string resource);

  // What the rpc is finished with. Call it once.
  grpc::Status End(const absl::Status& outcome);

 private:
  ObservedCall Observed() const;
  void ReportEnd(const absl::Status& outcome);
  absl::Status Admit(grpc::CallbackServerContext* context);

  std::string_view method_;
  CallKind kind_;
  AdmissionControl* gate_;  // null once ended, or moved from
  std::chrono::steady_clock::time_point start_;
  Authenticated authenticated_;
  bool counted_ = false;  // by the quotas
  std::string address_;
  std::string request_id_;
  std::string traceparent_;
  std::string resource_;
  bool served_ = false;  // the observer let it begin
  absl::Status admission_;
};

// A unary call of CallKind::kMetadata. `start` gets its scope, which lives until the end, and what
// ends it; it returns why the call fails, or OK and ends it once, now or later, on any thread.
using FinishCall = std::function<void(const absl::Status& outcome)>;
grpc::ServerUnaryReactor* HandleUnaryCall(
    grpc::CallbackServerContext* context, std::string_view method, AdmissionControl* gate,
    const std::function<absl::Status(CallScope& scope, const FinishCall& end)>& start);

// The same, but `start` runs in the lane.
grpc::ServerUnaryReactor* HandleUnaryCallIn(
    Lane lane, WorkerPool* pool, grpc::CallbackServerContext* context, std::string_view method,
    AdmissionControl* gate,
    std::function<absl::Status(CallScope& scope, const FinishCall& end)> start);

// The same for a call that waits for the store: `work` runs in Lane::kStore of `pool`, and its
// status ends the call. `work` must not keep `scope`.
grpc::ServerUnaryReactor* HandleStoreCall(grpc::CallbackServerContext* context,
                                          std::string_view method, AdmissionControl* gate,
                                          WorkerPool* pool,
                                          std::function<absl::Status(CallScope* scope)> work);

}  // namespace tissueform
