// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "absl/status/status.h"

#include "core/base/duration_histogram.h"
#include "core/base/mutex.h"
#include "server/platform/storage/database.h"

namespace tissueform {

// The one thread that reads and writes a database. Jobs run in the order in which they came; those
// that wait are committed together, because a commit costs what its sync costs, however many rows
// it writes. A job is answered after its commit.
class CommitThread {
 public:
  struct Job {
    // Reads and writes rows. Nothing of it stays when it fails. It may be called again after a
    // commit that failed, so what it leaves outside the database must be what its last call left.
    std::function<absl::Status(Database&)> work;
    // After the commit of a work that was OK; what it says is the answer. May be null. It reads
    // rows only.
    std::function<absl::Status(Database&)> after = nullptr;
    // Whether something was deleted for good: it is answered when it has left the log, too (unless
    // a reader keeps the log; then that is tried again until it is done).
    bool erases = false;
    // Called once, on this thread, without a lock held. It may submit, but not Run.
    std::function<void(absl::Status)> done = nullptr;
    std::chrono::steady_clock::time_point submitted = {};  // set by Submit
  };

  // `check` is asked after every commit; its error is the answer to all that was in it. `reader` is
  // another connection, which only reads.
  CommitThread(std::unique_ptr<Database> database, std::unique_ptr<Database> reader,
               std::function<absl::Status()> check);
  // For a database in memory, where grouping commits gains nothing: there is no thread, and Submit
  // and Run execute jobs on the caller's thread, one at a time.
  explicit CommitThread(std::unique_ptr<Database> in_memory);
  // Answers all that was submitted.
  ~CommitThread();
  CommitThread(const CommitThread&) = delete;
  CommitThread& operator=(const CommitThread&) = delete;

  // Any thread.
  void Submit(Job job);
  // Submits and waits. Any thread but its own, where it is an Internal error.
  absl::Status Run(Job job);

  // Reads committed data on the caller's thread without waiting for jobs; in memory as Run. Any
  // thread. `work` may open a transaction and must end it.
  absl::Status Read(const std::function<absl::Status(Database&)>& work);
  bool in_memory() const { return !thread_.joinable(); }

  // Of each job, from Submit to its answer, and of each Read.
  const DurationHistogram& latency() const { return latency_; }

 private:
  void Loop();
  // The jobs that wait, when there are some; none when it is time to end, or to empty the log.
  std::vector<Job> Next(bool* ending);
  void Answer(std::vector<Job> jobs);
  // Answers of `jobs` in one transaction. Not OK when the transaction has failed as a whole.
  absl::Status CommitTogether(std::vector<Job>& jobs, std::vector<absl::Status>* answers);
  absl::Status CommitAlone(Job& job);
  absl::Status CommitHere(Job& job) ABSL_LOCKS_EXCLUDED(mutex_);
  void TruncateLog();

  // The thread's.
  const std::unique_ptr<Database> database_;
  const std::function<absl::Status()> check_;
  bool log_holds_erased_ = false;

  // Also held while the log is truncated: an open read would keep deleted data in it.
  Mutex reader_mutex_;
  const std::unique_ptr<Database> reader_ ABSL_PT_GUARDED_BY(reader_mutex_);  // null: in memory

  DurationHistogram latency_;

  Mutex mutex_;
  ConditionVariable changed_;
  std::deque<Job> waiting_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
