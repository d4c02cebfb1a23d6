// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"

namespace tissueform {

class MemoryBudget;

// Bytes promised to somebody before they are allocated; given back when it is destroyed. The budget
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
// Thread-safe. Its locks are held over nothing else.
class MemoryBudget {
 public:
  // Asked, without a lock held, when a reservation of `bytes` does not fit: gives back what it can
  // spare, so that they do. The reservation is then tried once more.
  using Reclaimer = std::function<void(int64_t bytes)>;
  // The same where a reservation does not fit into what one owner may have.
  using AccountReclaimer = std::function<void(const std::string& owner, int64_t bytes)>;

  explicit MemoryBudget(int64_t limit_bytes) : limit_bytes_(limit_bytes) {}
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  // REQUIRES: called before the first reservation.
  void set_reclaimer(Reclaimer reclaimer) { reclaimer_ = std::move(reclaimer); }

  // What one owner may have: AccountOf then gives budgets of their own, parts of this one.
  // REQUIRES: as set_reclaimer.
  void set_account_limit(int64_t bytes, AccountReclaimer reclaimer);
  // Where this owner's reservations are made; lives as long as this one. This one itself where
  // owners have no limit, and for nobody (an empty name).
  MemoryBudget* AccountOf(const std::string& owner);

  // `what` is said in the message ("mesh", "matrix factor").
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

  // An account of `whole`.
  MemoryBudget(int64_t limit_bytes, MemoryBudget* whole)
      : limit_bytes_(limit_bytes), whole_(whole) {}

  absl::Status Refusal(int64_t bytes, absl::string_view what) const;
  absl::Status Take(int64_t bytes, absl::string_view what);
  bool TryTake(int64_t bytes);
  void GiveBack(int64_t bytes);
  void GiveBackHere(int64_t bytes);  // not to the whole

  // Constant once requests are served.
  const int64_t limit_bytes_;
  MemoryBudget* const whole_ = nullptr;  // of an account: what it is a part of
  Reclaimer reclaimer_;
  int64_t account_limit_bytes_ = 0;  // 0: owners have none
  AccountReclaimer account_reclaimer_;

  Mutex accounts_mutex_;
  std::map<std::string, std::unique_ptr<MemoryBudget>> accounts_ ABSL_GUARDED_BY(accounts_mutex_);

  mutable Mutex mutex_;
  int64_t reserved_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t most_reserved_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace tissueform
