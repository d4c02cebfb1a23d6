// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"

namespace tissueform {

class MemoryBudget;

// Bytes that are reserved before they are allocated; given back when it is destroyed. The budget
// must outlive it. One thread at a time.
class MemoryReservation {
 public:
  MemoryReservation() = default;
  MemoryReservation(MemoryReservation&& other) noexcept;
  MemoryReservation& operator=(MemoryReservation&& other) noexcept;
  ~MemoryReservation();

  int64_t bytes() const { return bytes_; }

  // Changes the reservation to `bytes`. Less always succeeds; more fails like MemoryBudget::Reserve
  // and leaves the reservation as it was. REQUIRES: made by MemoryBudget::Reserve.
  absl::Status Resize(int64_t bytes, absl::string_view what);

 private:
  friend class MemoryBudget;

  MemoryReservation(MemoryBudget* budget, int64_t bytes) : budget_(budget), bytes_(bytes) {}

  MemoryBudget* budget_ = nullptr;
  int64_t bytes_ = 0;
};

// How much memory meshes and sessions may hold together, and those of one owner. What does not fit
// is refused before it is allocated.
//
// The budget calls nothing that could free memory. One thread may ask it which reservations do not
// fit (WaitForShortage), free memory, and say so (AnswerShortage). While it does, such a
// reservation blocks until its answer, and is then made if it fits.
//
// Thread-safe. Its locks are held over nothing else.
class MemoryBudget {
 public:
  explicit MemoryBudget(int64_t limit_bytes) : limit_bytes_(limit_bytes) {}
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  // A reservation that does not fit.
  struct Shortage {
    std::string owner;  // into what this owner may have; empty: into the whole
    int64_t bytes = 0;
  };
  // Reservations that do not fit wait for their answers between the two. One thread at a time; it
  // makes no reservation itself.
  void BeginReclaiming() ABSL_LOCKS_EXCLUDED(mutex_);
  void EndReclaiming() ABSL_LOCKS_EXCLUDED(mutex_);
  // The oldest one; blocks until there is one. Empty after EndReclaiming.
  std::optional<Shortage> WaitForShortage() ABSL_LOCKS_EXCLUDED(mutex_);
  // What could be given back for the oldest one was. It is made at once, if it fits: the next one
  // does not get the same room.
  void AnswerShortage() ABSL_LOCKS_EXCLUDED(mutex_);

  // What one owner may have: AccountOf then gives budgets of their own, parts of this one.
  // REQUIRES: called before the first reservation.
  void set_account_limit(int64_t bytes) { account_limit_bytes_ = bytes; }
  // Where this owner's reservations are made; lives as long as this one. This one itself where
  // owners have no limit, and for an empty name.
  MemoryBudget* AccountOf(const std::string& owner);

  // `what` is said in the message ("mesh", "matrix factor").
  //
  // Blocks while memory is freed for it.
  //
  // Errors: ResourceExhausted, with what is asked, what is taken and the limit: of all
  // (MEMORY_BUDGET_FULL), or of one owner (QUOTA_EXCEEDED).
  absl::StatusOr<MemoryReservation> Reserve(int64_t bytes, absl::string_view what);

  int64_t limit_bytes() const { return limit_bytes_; }
  int64_t reserved_bytes() const;
  // The most that was reserved at one time.
  int64_t most_reserved_bytes() const;

 private:
  friend class MemoryReservation;

  // The account of an owner.
  MemoryBudget(int64_t limit_bytes, MemoryBudget* whole, std::string owner)
      : limit_bytes_(limit_bytes), whole_(whole), owner_(std::move(owner)) {}

  absl::Status Refusal(int64_t bytes, absl::string_view what) const;
  absl::Status Take(int64_t bytes, absl::string_view what);
  bool TryTake(int64_t bytes);
  bool TryTakeLocked(int64_t bytes) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Of the whole: waits for the answer to a shortage of `budget`, which is an account or this one.
  // False at once if memory is not reclaimed.
  bool TakeReclaimed(MemoryBudget* budget, int64_t bytes) ABSL_LOCKS_EXCLUDED(mutex_);
  void GiveBack(int64_t bytes);
  void GiveBackHere(int64_t bytes);  // not to the whole

  // Constant once requests are served.
  const int64_t limit_bytes_;
  MemoryBudget* const whole_ = nullptr;  // of an account: what it is a part of
  const std::string owner_;              // of an account
  int64_t account_limit_bytes_ = 0;      // 0: owners have none

  Mutex accounts_mutex_;
  std::map<std::string, std::unique_ptr<MemoryBudget>> accounts_ ABSL_GUARDED_BY(accounts_mutex_);

  mutable Mutex mutex_;
  int64_t reserved_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t most_reserved_bytes_ ABSL_GUARDED_BY(mutex_) = 0;

  // Of the whole, whose lock comes before those of the accounts.
  struct Waiting {
    MemoryBudget* budget = nullptr;
    int64_t bytes = 0;
    bool is_answered = false;
    bool is_taken = false;
  };
  ConditionVariable asked_or_answered_;
  bool reclaims_ ABSL_GUARDED_BY(mutex_) = false;
  std::deque<Waiting*> waiting_ ABSL_GUARDED_BY(mutex_);  // the oldest first
};

}  // namespace tissueform
