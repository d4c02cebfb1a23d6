// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <iterator>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "server/platform/audit/audit_sink.h"

namespace tissueform::testing {

// What a AuditRecorder has taken, and whether it takes more. Thread-safe.
class AuditRecord {
 public:
  std::vector<std::string> messages() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  // It takes so many more, then it is full.
  void Limit(size_t more) {
    const std::lock_guard<std::mutex> lock(mutex_);
    limit_ = messages_.size() + more;
  }
  void Lift() {
    const std::lock_guard<std::mutex> lock(mutex_);
    limit_ = static_cast<size_t>(-1);
  }
  absl::Status Take(std::deque<std::string>* messages) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (; !messages->empty(); messages->pop_front()) {
      if (messages_.size() >= limit_) return absl::ResourceExhaustedError("the sink is full");
      messages_.push_back(messages->front());
    }
    return absl::OkStatus();
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
  size_t limit_ = static_cast<size_t>(-1);
};

class AuditRecorder final : public AuditSink {
 public:
  // `record` must outlive it.
  explicit AuditRecorder(AuditRecord* record) : record_(record) {}
  absl::Status Take(std::deque<std::string>* messages) override { return record_->Take(messages); }

 private:
  AuditRecord* const record_;
};

}  // namespace tissueform::testing
