// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_log.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_format.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

constexpr size_t kMaxTogether = 1024;

absl::Status NotWritten(const char* why) {
  return WithReason(absl::UnavailableError(absl::StrFormat(
                        "the audit log %s, so audited work is refused; try again later, or tell "
                        "the operator",
                        why)),
                    ErrorReason::kAuditNotWritten);
}

}  // namespace

AuditLog::AuditLog(std::unique_ptr<AuditSink> sink, Options options)
    : options_(std::move(options)), sink_(std::move(sink)), thread_([this] { Work(); }) {}

AuditLog::~AuditLog() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

absl::Status AuditLog::Reserve(int places) {
  MutexLock lock(mutex_);
  if (counts_.failing) return NotWritten("cannot be written");
  if (waiting_.size() + reserved_ + static_cast<size_t>(places) > options_.max_waiting) {
    return NotWritten("is behind");
  }
  reserved_ += static_cast<size_t>(places);
  return absl::OkStatus();
}

void AuditLog::Release(int places) {
  MutexLock lock(mutex_);
  reserved_ -= std::min(reserved_, static_cast<size_t>(places));
}

void AuditLog::Write(std::string message) {
  {
    MutexLock lock(mutex_);
    if (reserved_ > 0) --reserved_;
    waiting_.push_back(std::move(message));
  }
  changed_.NotifyAll();
}

void AuditLog::WriteIfRoom(std::string message) {
  {
    MutexLock lock(mutex_);
    if (waiting_.size() + reserved_ >= options_.max_waiting) {
      ++counts_.lost;
      ++unreported_lost_;
      return;
    }
    waiting_.push_back(std::move(message));
  }
  changed_.NotifyAll();
}

bool AuditLog::Flush() {
  MutexLock lock(mutex_);
  while (!counts_.failing && (!waiting_.empty() || counts_.waiting > 0)) changed_.Wait(mutex_);
  return !counts_.failing;
}

AuditLog::Counts AuditLog::Read() const {
  MutexLock lock(mutex_);
  Counts counts = counts_;
  counts.waiting += static_cast<int64_t>(waiting_.size());
  return counts;
}

bool AuditLog::WaitForWork() {
  const auto next_try = std::chrono::steady_clock::now() + options_.retry;
  while (counts_.failing && !ending_ && changed_.WaitUntil(mutex_, next_try)) {
  }
  while (waiting_.empty() && !ending_) changed_.Wait(mutex_);
  return !waiting_.empty();
}

void AuditLog::Work() {
  MutexLock lock(mutex_);
  while (WaitForWork()) {
    WriteBatch();
    if (ending_ && counts_.failing) {
      spdlog::error("audit: {} events could not be written before shutdown", waiting_.size());
      return;
    }
  }
}

std::deque<std::string> AuditLog::TakeBatch() {
  const auto end =
      waiting_.begin() + static_cast<std::ptrdiff_t>(std::min(waiting_.size(), kMaxTogether));
  std::deque<std::string> batch(std::make_move_iterator(waiting_.begin()),
                                std::make_move_iterator(end));
  waiting_.erase(waiting_.begin(), end);
  if (unreported_lost_ > 0 && options_.lost_message != nullptr) {
    batch.push_front(options_.lost_message(std::exchange(unreported_lost_, 0)));
  }
  return batch;
}

void AuditLog::WriteBatch() {
  std::deque<std::string> batch = TakeBatch();
  const auto count = static_cast<int64_t>(batch.size());
  counts_.waiting = count;  // still ours
  mutex_.Unlock();
  const absl::Status status = sink_->Take(&batch);
  mutex_.Lock();
  counts_.waiting = 0;
  counts_.written += count - static_cast<int64_t>(batch.size());
  waiting_.insert(waiting_.begin(), std::make_move_iterator(batch.begin()),
                  std::make_move_iterator(batch.end()));
  if (!status.ok() && !counts_.failing) {
    spdlog::error("{}; audited work is refused until they can be written",
                  std::string(status.message()));
  } else if (status.ok() && counts_.failing) {
    spdlog::info("the audit log is writable again");
  }
  counts_.failing = !status.ok();
  changed_.NotifyAll();
}

}  // namespace tissueform
