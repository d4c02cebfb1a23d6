// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// Where a server takes the time from that its leases run by. Any thread may call it.
using SteadyNow = std::function<std::chrono::steady_clock::time_point()>;
// Never goes back, and goes on while the machine sleeps, as a database elsewhere does.
std::chrono::steady_clock::time_point AwakeOrNotNow();

struct LeaseOptions {
  std::chrono::milliseconds duration{10'000};
  // So long before a lease ends its holder answers no more: for clocks that run apart and for
  // answers on their way.
  std::chrono::milliseconds margin{1'000};
  // What a call waits for the store: less than `duration`, so that there is another try.
  std::chrono::milliseconds patience{2'000};
};

// That a session is held, and until when its holder may answer.
struct SessionLease {
  std::string session = {};
  int64_t epoch = 0;                                         // under which it is written
  std::chrono::steady_clock::time_point answers_until = {};  // kAsBefore: as known before

  static constexpr std::chrono::steady_clock::time_point kAsBefore = {};
};

// What became of an Acquire.
struct LeaseAnswer {
  bool mine = false;
  SessionLease lease = {};  // where it is mine
  std::string node = {};    // who holds it otherwise: where clients find the session
};

// Which of several servers holds a session: one at a time, by a lease on the store's clock. An
// epoch belongs to one holder: a server that takes a session over gets one that is greater than
// all given before, for any session, and the store refuses writes under any lower one. If epochs
// were counted for each session, one that is deleted and made again would begin with epochs that
// an earlier holder still has. A lease that has run out is lost even when no server has taken the
// session over; a server that wants it acquires it again.
//
// An object of this kind is one holder. Calls block; thread-safe. Errors: what the store says,
// Unavailable above all; then nothing is known, and Acquire and Renew may be called again: a server
// that holds a session already keeps its epoch.
class SessionLeases {
 public:
  virtual ~SessionLeases() = default;

  // Takes a session that no server holds, or whose lease has run out, under a new epoch; renews the
  // lease of one that this holds already. Errors: NotFound.
  virtual absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) = 0;

  // Renews the leases of all sessions that this still holds; returns those. Others are lost.
  // It does not wait for a session that is being written at this moment: that is held as before.
  virtual absl::StatusOr<std::vector<SessionLease>> Renew() = 0;

  // Others may take it at once. Nothing happens when it is no longer held under this epoch.
  virtual absl::Status Release(const std::string& session, int64_t epoch) = 0;
};

}  // namespace tissueform
