// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/status.h"

#include "client/cpp/session_routes.h"
#include "core/base/backoff.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {

// Which failures of a call make it worth another attempt.
enum class CallRepeat {
  // Done twice is done once: also when the connection or the server is lost in the middle.
  kAlways,
  // Only when the server says that it has done nothing.
  kIfNothingWasDone,
};

// How often one call goes to the server that an error names without waiting in between.
inline constexpr int kMaxHops = 4;
// For how long a call is tried again while a server of a cluster is away: until another one may
// hold its sessions, which takes 10 s, and has prepared them.
inline constexpr std::chrono::milliseconds kFailoverPatience{30'000};
inline constexpr std::chrono::milliseconds kNoPatience{0};

// The attempts of one call that may concern a session. What is decided after each:
//
//   error                                       at a cluster's servers           at a server alone
//   SESSION_MOVED, MEMORY_BUDGET_FULL + node    there, at once; kMaxHops times  (never said)
//   SESSION_MOVED without node                  at once, then after a wait       (never said)
//   WRONG_NODE, SERVER_DRAINING                 after a wait                     over
//   UNAVAILABLE, UNKNOWN, INTERNAL              after a wait if kAlways          over
//   any other                                   over                             over
//
// (CANCELLED that another party caused is UNAVAILABLE here: EndOfCall.)
//
// Waits grow and differ by chance (Backoff); it is over when `patience` has passed since the first
// error. One thread at a time.
class SessionAttempts {
 public:
  // `session` is "sessions/{id}"; empty: of none yet. `routes` must outlive it.
  SessionAttempts(SessionRoutes* routes, std::string session, CallRepeat repeat,
                  std::chrono::milliseconds patience = kFailoverPatience);

  // Adds the headers of the next attempt.
  void AddHeaders(grpc::ClientContext* context) const;
  // The last attempt began well: remembers who answered.
  void Succeeded(const grpc::ClientContext& context) const;
  // How long to wait before the next attempt; nullopt: no further attempt, return the error.
  std::optional<std::chrono::milliseconds> AfterError(const absl::Status& error);

 private:
  std::optional<std::chrono::milliseconds> Wait(const absl::Status& error);

  SessionRoutes* const routes_;
  const std::string session_;
  const CallRepeat repeat_;
  const std::chrono::milliseconds patience_;
  Backoff backoff_{Backoff::Options{}};
  int hops_ = 0;
  bool tried_at_once_ = false;
  std::string node_;  // where a call without a session was sent on to
  std::optional<std::chrono::steady_clock::time_point> give_up_;
};

// The same for what begins with a first message: `open` gives a StatusOr, and remembers who
// answered.
template <typename Open>
auto OpenWithAttempts(SessionAttempts attempts, const Open& open) -> decltype(open()) {
  while (true) {
    auto opened = open();
    if (opened.ok()) return opened;
    const std::optional<std::chrono::milliseconds> wait = attempts.AfterError(opened.status());
    if (!wait.has_value()) return opened;
    std::this_thread::sleep_for(*wait);
  }
}

// A call as the attempts say, each with a context of its own with headers and `deadline`. `attempt`
// makes it and blocks; it may read the context's metadata when it has ended.
absl::Status RunSessionCall(SessionRoutes* routes, const std::string& session, CallRepeat repeat,
                            std::chrono::system_clock::time_point deadline,
                            const std::function<grpc::Status(grpc::ClientContext*)>& attempt);

// The same of a call that deletes: NOT_FOUND after an attempt that was lost says that it was done.
// What is deleted is forgotten by `routes` where it is a session.
absl::Status RunDeletion(SessionRoutes* routes, const std::string& session,
                         std::chrono::system_clock::time_point deadline,
                         const std::function<grpc::Status(grpc::ClientContext*)>& attempt);

// How creating and updating a session may be repeated. In a cluster a new session without a
// request_id is given one: what was created by an attempt that was lost is then found again.
CallRepeat PrepareToRepeat(const SessionRoutes& routes, v1::CreateSessionRequest* request);
CallRepeat RepeatOf(const v1::UpdateSessionRequest& request);

}  // namespace tissueform
