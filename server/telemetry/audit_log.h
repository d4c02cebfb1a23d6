// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/platform/audit_chain/audit_key.h"
#include "server/telemetry/audit_file.h"

namespace tissueform {

// An audit log that nobody waits for: lines wait in a queue of limited length for a thread that
// writes them, those that wait together with one sync. Whoever will have something to tell reserves
// a place before; there is none while the log cannot be written.
//
// Lines are the inside of a JSON object. Thread-safe.
class AuditLog {
 public:
  struct Options {
    AuditFile::Options file;
    // Is told where the log is, now and then and at the end of a run; null: nobody is.
    std::function<void(const std::string& text)> checkpoint = nullptr;
    size_t most = 16'384;              // lines that wait, and places that are reserved
    uint64_t checkpoint_lines = 1000;  // between two
    std::chrono::seconds checkpoint_interval{300};
    std::chrono::milliseconds retry{1000};  // after a write that has failed
  };
  struct Counts {
    int64_t written = 0;
    int64_t lost = 0;  // for which there was no room
    int64_t waiting = 0;
    bool failing = false;
  };

  // Errors: those of AuditFile::Open.
  static absl::StatusOr<std::unique_ptr<AuditLog>> Open(AuditKey key, Options options);
  // Writes what waits, or says in the program's log that it cannot.
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  // Places for lines to come. Errors: Unavailable with AUDIT_NOT_WRITTEN while the log cannot be
  // written, or too much waits already.
  absl::Status Reserve(int places);
  // A line, in a place that was reserved.
  void Write(std::string line);
  // Where there is room; else it is counted, and the next line says how many were lost.
  void WriteIfRoom(std::string line);

  // Looks whether the file was moved away, and begins a new one then.
  void CheckFile();
  // Blocks until everything that was given is written. False when that fails.
  bool Flush();

  Counts Read() const;

 private:
  AuditLog(std::unique_ptr<AuditFile> file, Options options);

  void Work();
  // Blocks until there is something to do. False: to end, and nothing waits.
  bool WaitForWork() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Writes what waits.
  void WriteBatch() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Of the thread, or of the destructor.
  void TellCheckpoint();

  // Constant.
  const Options options_;

  // The thread's.
  const std::unique_ptr<AuditFile> file_;
  AuditPosition told_;
  std::chrono::steady_clock::time_point told_at_;

  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::deque<std::string> waiting_ ABSL_GUARDED_BY(mutex_);
  size_t reserved_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t lost_untold_ ABSL_GUARDED_BY(mutex_) = 0;
  Counts counts_ ABSL_GUARDED_BY(mutex_);
  bool check_file_ ABSL_GUARDED_BY(mutex_) = false;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
