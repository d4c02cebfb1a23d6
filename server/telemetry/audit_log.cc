// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_log.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// More would make a file grow far beyond its size before the next one begins.
constexpr size_t kMaxTogether = 1024;

absl::Status NotWritten(const char* why) {
  return WithReason(
      absl::UnavailableError(absl::StrFormat(
          "the audit log %s, so the server refuses audited calls; try again later, or "
          "tell its operator",
          why)),
      ErrorReason::kAuditNotWritten);
}

std::string LostLine(int64_t count) {
  return absl::StrFormat("\"event\":\"lost\",\"time\":\"%s\",\"count\":%d",
                         absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone()),
                         count);
}

}  // namespace

absl::StatusOr<std::unique_ptr<AuditLog>> AuditLog::Open(AuditKey key, Options options) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<AuditFile> file,
                      AuditFile::Open(std::move(key), options.file));
  return std::unique_ptr<AuditLog>(new AuditLog(std::move(file), std::move(options)));
}

AuditLog::AuditLog(std::unique_ptr<AuditFile> file, Options options)
    : options_(std::move(options)),
      file_(std::move(file)),
      told_at_(std::chrono::steady_clock::now()),
      thread_([this] { Work(); }) {}

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
  if (waiting_.size() + reserved_ + static_cast<size_t>(places) > options_.most) {
    return NotWritten("is behind");
  }
  reserved_ += static_cast<size_t>(places);
  return absl::OkStatus();
}

void AuditLog::Write(std::string line) {
  {
    MutexLock lock(mutex_);
    if (reserved_ > 0) --reserved_;
    waiting_.push_back(std::move(line));
  }
  changed_.NotifyAll();
}

void AuditLog::WriteIfRoom(std::string line) {
  {
    MutexLock lock(mutex_);
    if (waiting_.size() + reserved_ >= options_.most) {
      ++counts_.lost;
      ++lost_untold_;
      return;
    }
    waiting_.push_back(std::move(line));
  }
  changed_.NotifyAll();
}

void AuditLog::CheckFile() {
  {
    MutexLock lock(mutex_);
    check_file_ = true;
  }
  changed_.NotifyAll();
}

bool AuditLog::Flush() {
  MutexLock lock(mutex_);
  while (!counts_.failing && (!waiting_.empty() || counts_.waiting > 0 || check_file_)) {
    changed_.Wait(mutex_);
  }
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
  const auto checkpoint = told_at_ + options_.checkpoint_interval;
  while (waiting_.empty() && !ending_ && !check_file_ && !counts_.failing) {
    if (options_.checkpoint == nullptr || told_ == file_->position()) {
      changed_.Wait(mutex_);
    } else if (!changed_.WaitUntil(mutex_, checkpoint)) {
      return true;
    }
  }
  return !ending_ || !waiting_.empty();
}

void AuditLog::Work() {
  MutexLock lock(mutex_);
  while (WaitForWork()) {
    WriteBatch();
    if (ending_ && counts_.failing) {
      spdlog::error("audit: {} lines could not be written before shutdown", waiting_.size());
      break;
    }
  }
  if (options_.checkpoint != nullptr && told_ != file_->position()) TellCheckpoint();
}

void AuditLog::WriteBatch() {
  std::vector<std::string> batch;
  const size_t count = std::min(waiting_.size(), kMaxTogether);
  std::move(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count),
            std::back_inserter(batch));
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
  counts_.waiting = static_cast<int64_t>(count);  // still ours
  const int64_t lost = std::exchange(lost_untold_, 0);
  if (lost > 0) batch.insert(batch.begin(), LostLine(lost));
  check_file_ = false;
  mutex_.Unlock();
  const absl::Status status = file_->Append(batch);
  const bool is_due = file_->position().number - told_.number >= options_.checkpoint_lines ||
                      std::chrono::steady_clock::now() - told_at_ >= options_.checkpoint_interval;
  if (status.ok() && options_.checkpoint != nullptr && is_due) TellCheckpoint();
  mutex_.Lock();
  counts_.waiting = 0;
  if (!status.ok()) {
    if (lost > 0) batch.erase(batch.begin());
    lost_untold_ += lost;
    waiting_.insert(waiting_.begin(), std::make_move_iterator(batch.begin()),
                    std::make_move_iterator(batch.end()));
    if (!counts_.failing) {
      spdlog::error("{}; audited calls are refused until then", std::string(status.message()));
    }
  } else {
    counts_.written += static_cast<int64_t>(batch.size());
    if (counts_.failing) spdlog::info("the audit log is writable again");
  }
  counts_.failing = !status.ok();
  changed_.NotifyAll();
}

void AuditLog::TellCheckpoint() {
  told_ = file_->position();
  told_at_ = std::chrono::steady_clock::now();
  options_.checkpoint(CheckpointText(told_));
}

}  // namespace tissueform
