// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/platform/audit/audit_sink.h"

namespace tissueform {

// Audit messages wait in a queue of limited length for a thread that gives them to a sink; callers
// do not wait. A caller that will have a message reserves a place first. Reserving fails while the
// sink takes nothing.
//
// Messages are as AuditSink::Take describes them. Thread-safe.
class AuditLog {
 public:
  struct Options {
    // Makes the message that says how many others found no room; null: those are only counted.
    std::function<std::string(int64_t count)> lost_message = nullptr;
    size_t max_waiting = 16'384;            // messages that wait, and places that are reserved
    std::chrono::milliseconds retry{1000};  // after the sink has refused
  };
  struct Counts {
    int64_t written = 0;
    int64_t lost = 0;  // for which there was no room
    int64_t waiting = 0;
    bool failing = false;
  };

  explicit AuditLog(std::unique_ptr<AuditSink> sink, Options options);
  // Gives the sink what waits, or logs that it cannot.
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  // Places for messages to come. Errors: Unavailable with AUDIT_NOT_WRITTEN while the sink takes
  // nothing, or too much waits already.
  absl::Status Reserve(int places);
  // Returns places that stay empty.
  void Release(int places);
  // A message, in a place that was reserved.
  void Write(std::string message);
  // Where there is room; otherwise it is counted, and the next message says how many were lost.
  void WriteIfRoom(std::string message);

  // Blocks until the sink has taken everything. False when it takes nothing.
  bool Flush();

  Counts Read() const;
  double BufferUse() const { return sink_->BufferUse(); }

 private:
  void Work();
  // Blocks until there is something to do. False: to end, and nothing waits.
  bool WaitForWork() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Gives the sink what waits.
  void WriteBatch() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::deque<std::string> TakeBatch() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Options options_;
  const std::unique_ptr<AuditSink> sink_;  // taken from by the thread

  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::deque<std::string> waiting_ ABSL_GUARDED_BY(mutex_);
  size_t reserved_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t unreported_lost_ ABSL_GUARDED_BY(mutex_) = 0;
  Counts counts_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
