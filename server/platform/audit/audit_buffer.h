// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

#include "core/base/mutex.h"
#include "server/platform/storage/database.h"

namespace tissueform {

// Messages on the disk that a collector does not have yet, in a file of limited size that one
// process holds. Their numbers rise by one from message to message, also over restarts.
//
// Thread-safe. Errors of all: those of Database.
class AuditBuffer {
 public:
  struct Message {
    int64_t number = 0;
    absl::Time time;
    std::string text;
  };

  // Opens the file, or makes one for its owner only. `max_bytes` limits the texts.
  static absl::StatusOr<std::unique_ptr<AuditBuffer>> Open(const std::string& path,
                                                           int64_t max_bytes);

  // Moves messages from the front to the disk; on it when it returns. Errors: also
  // ResourceExhausted: those that remain found no room.
  absl::Status Append(std::deque<std::string>* messages);

  // The oldest messages after this number, at most `count`.
  absl::StatusOr<std::vector<Message>> Read(int64_t after, int count);
  // Those up to and with this number. When none is left, none of their bytes is on the disk.
  absl::Status Remove(int64_t number);

  // Part of the room that is used. Does not block.
  double Use() const;

 private:
  AuditBuffer(std::unique_ptr<Database> database, int64_t max_bytes)
      : max_bytes_(max_bytes), database_(std::move(database)) {}

  // Of the messages up to and with this number.
  absl::StatusOr<int64_t> BytesUpTo(int64_t number) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status Insert(const std::deque<std::string>& messages, size_t count)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const int64_t max_bytes_;
  mutable Mutex mutex_;
  const std::unique_ptr<Database> database_ ABSL_PT_GUARDED_BY(mutex_);
  std::atomic<int64_t> bytes_ = 0;  // changes under the mutex
};

}  // namespace tissueform
