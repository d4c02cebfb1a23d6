// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/memory_budget.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// When a session that is no longer in use may be evicted (SessionTable::kInUse).
constexpr int64_t kSessionsInUseMs = 10'000;

std::string Mebibytes(int64_t bytes) {
  return absl::StrFormat("%.1f MiB", static_cast<double>(bytes) / (1 << 20));
}

}  // namespace

MemoryReservation::MemoryReservation(MemoryReservation&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

MemoryReservation& MemoryReservation::operator=(MemoryReservation&& other) noexcept {
  MemoryReservation taken(std::move(other));
  std::swap(budget_, taken.budget_);
  std::swap(bytes_, taken.bytes_);
  return *this;
}

MemoryReservation::~MemoryReservation() {
  if (budget_ != nullptr) {
    budget_->GiveBack(bytes_);
  }
}

absl::Status MemoryReservation::Resize(int64_t bytes, absl::string_view what) {
  if (bytes > bytes_) {
    TF_RETURN_IF_ERROR(budget_->Take(bytes - bytes_, what));
  } else {
    budget_->GiveBack(bytes_ - bytes);
  }
  bytes_ = bytes;
  return absl::OkStatus();
}

absl::StatusOr<MemoryReservation> MemoryBudget::Reserve(int64_t bytes, absl::string_view what) {
  TF_RETURN_IF_ERROR(Take(bytes, what));
  return MemoryReservation(this, bytes);
}

int64_t MemoryBudget::reserved_bytes() const {
  MutexLock lock(mutex_);
  return reserved_bytes_;
}

int64_t MemoryBudget::most_reserved_bytes() const {
  MutexLock lock(mutex_);
  return most_reserved_bytes_;
}

MemoryBudget* MemoryBudget::AccountOf(const std::string& owner) {
  if (owner.empty() || account_limit_bytes_ == 0) return this;
  MutexLock lock(accounts_mutex_);
  std::unique_ptr<MemoryBudget>& account = accounts_[owner];
  if (account == nullptr) {
    account = absl::WrapUnique(new MemoryBudget(account_limit_bytes_, this, owner));
  }
  return account.get();
}

absl::Status MemoryBudget::Take(int64_t bytes, absl::string_view what) {
  // Once more and no oftener: all that can be spared was given back.
  MemoryBudget* const whole = whole_ == nullptr ? this : whole_;
  if (!TryTake(bytes) && !whole->TakeReclaimed(this, bytes)) return Refusal(bytes, what);
  if (whole_ == nullptr) return absl::OkStatus();
  const absl::Status of_whole = whole_->Take(bytes, what);
  if (!of_whole.ok()) GiveBackHere(bytes);
  return of_whole;
}

bool MemoryBudget::TakeReclaimed(MemoryBudget* budget, int64_t bytes) {
  MutexLock lock(mutex_);
  if (!reclaims_) return false;
  Waiting waiting = {.budget = budget, .bytes = bytes};
  waiting_.push_back(&waiting);
  asked_or_answered_.NotifyAll();
  while (!waiting.is_answered) asked_or_answered_.Wait(mutex_);
  return waiting.is_taken;
}

std::optional<MemoryBudget::Shortage> MemoryBudget::WaitForShortage() {
  MutexLock lock(mutex_);
  while (reclaims_ && waiting_.empty()) asked_or_answered_.Wait(mutex_);
  if (!reclaims_) return std::nullopt;
  const Waiting& oldest = *waiting_.front();
  return Shortage{oldest.budget->owner_, oldest.bytes};
}

void MemoryBudget::AnswerShortage() {
  MutexLock lock(mutex_);
  if (waiting_.empty()) return;  // reclaiming has ended
  Waiting& oldest = *waiting_.front();
  waiting_.pop_front();
  oldest.is_answered = true;
  oldest.is_taken =
      oldest.budget == this ? TryTakeLocked(oldest.bytes) : oldest.budget->TryTake(oldest.bytes);
  asked_or_answered_.NotifyAll();
}

void MemoryBudget::BeginReclaiming() {
  MutexLock lock(mutex_);
  reclaims_ = true;
}

void MemoryBudget::EndReclaiming() {
  MutexLock lock(mutex_);
  reclaims_ = false;
  for (Waiting* waiting : waiting_) waiting->is_answered = true;
  waiting_.clear();
  asked_or_answered_.NotifyAll();
}

absl::Status MemoryBudget::Refusal(int64_t bytes, absl::string_view what) const {
  const std::string needs =
      absl::StrCat("no memory for the ", what, ": it needs ", Mebibytes(bytes), ", and ",
                   Mebibytes(reserved_bytes()), " of ", Mebibytes(limit_bytes_));
  const ErrorMetadata numbers = {{"needed_bytes", absl::StrCat(bytes)},
                                 {"limit_bytes", absl::StrCat(limit_bytes_)}};
  if (whole_ == nullptr) {
    return WithReason(
        absl::ResourceExhaustedError(absl::StrCat(
            needs,
            " are in use; delete sessions or meshes, or raise --memory-budget-mib of the "
            "server")),
        ErrorReason::kMemoryBudgetFull, numbers);
  }
  ErrorMetadata of_quota = numbers;
  of_quota["quota"] = "memory-mib";
  of_quota["retry_after_ms"] = absl::StrCat(kSessionsInUseMs);
  return WithReason(absl::ResourceExhaustedError(absl::StrCat(
                        needs, " of your quota are in use; delete sessions, try again in ",
                        kSessionsInUseMs / 1000,
                        " s, or request a larger quota (--quota-memory-mib of the server)")),
                    ErrorReason::kQuotaExceeded, of_quota);
}

bool MemoryBudget::TryTake(int64_t bytes) {
  MutexLock lock(mutex_);
  return TryTakeLocked(bytes);
}

bool MemoryBudget::TryTakeLocked(int64_t bytes) {
  // A difference, because the sum of what is asked and what is taken might overflow.
  if (bytes > limit_bytes_ - reserved_bytes_) {
    return false;
  }
  reserved_bytes_ += bytes;
  most_reserved_bytes_ = std::max(most_reserved_bytes_, reserved_bytes_);
  return true;
}

void MemoryBudget::GiveBack(int64_t bytes) {
  GiveBackHere(bytes);
  if (whole_ != nullptr) whole_->GiveBack(bytes);
}

void MemoryBudget::GiveBackHere(int64_t bytes) {
  MutexLock lock(mutex_);
  reserved_bytes_ -= bytes;
}

}  // namespace tissueform
