// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/commit_thread.h"

#include <chrono>
#include <future>
#include <utility>

#include "core/base/status_macros.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

// More would make the first of them wait for the last for no gain: the sync is shared already.
constexpr size_t kMaxTogether = 64;
// When a backup reads the log that should be emptied.
constexpr std::chrono::seconds kTruncateAgain{1};

}  // namespace

CommitThread::CommitThread(std::unique_ptr<Database> database, std::unique_ptr<Database> reader,
                           std::function<absl::Status()> check)
    : database_(std::move(database)),
      check_(std::move(check)),
      reader_(std::move(reader)),
      thread_([this] { Loop(); }) {}

CommitThread::CommitThread(std::unique_ptr<Database> in_memory) : database_(std::move(in_memory)) {}

CommitThread::~CommitThread() {
  if (in_memory()) return;
  {
    MutexLock lock(mutex_);
    ending_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

void CommitThread::Submit(Job job) {
  if (in_memory()) {
    absl::Status status = CommitHere(job);
    if (job.done) job.done(std::move(status));
    return;
  }
  job.submitted = std::chrono::steady_clock::now();
  {
    MutexLock lock(mutex_);
    waiting_.push_back(std::move(job));
  }
  changed_.NotifyOne();
}

absl::Status CommitThread::Run(Job job) {
  if (in_memory()) return CommitHere(job);
  if (std::this_thread::get_id() == thread_.get_id()) {
    return absl::InternalError("store: a blocking call on the store's own thread");
  }
  std::promise<absl::Status> answer;
  std::future<absl::Status> future = answer.get_future();
  job.done = [&answer](absl::Status status) { answer.set_value(std::move(status)); };
  Submit(std::move(job));
  return future.get();
}

absl::Status CommitThread::CommitHere(Job& job) {
  MutexLock lock(mutex_);
  TF_RETURN_IF_ERROR(CommitAlone(job));
  return job.after ? job.after(*database_) : absl::OkStatus();
}

absl::Status CommitThread::Read(const std::function<absl::Status(Database&)>& work) {
  if (in_memory()) return Run({.work = work});
  const auto begin = std::chrono::steady_clock::now();
  absl::Status status;
  {
    MutexLock lock(reader_mutex_);
    status = work(*reader_);
  }
  latency_.Observe(std::chrono::steady_clock::now() - begin);
  return status;
}

void CommitThread::Loop() {
  bool ending = false;
  while (!ending) {
    std::vector<Job> jobs = Next(&ending);
    if (!jobs.empty()) {
      Answer(std::move(jobs));
      ending = false;  // there may be more
    } else if (log_holds_erased_) {
      TruncateLog();
    }
  }
}

std::vector<CommitThread::Job> CommitThread::Next(bool* ending) {
  std::vector<Job> jobs;
  MutexLock lock(mutex_);
  bool in_time = true;
  while (waiting_.empty() && !ending_ && in_time) {
    if (log_holds_erased_) {
      in_time = changed_.WaitUntil(mutex_, std::chrono::steady_clock::now() + kTruncateAgain);
    } else {
      changed_.Wait(mutex_);
    }
  }
  *ending = ending_;
  while (!waiting_.empty() && jobs.size() < kMaxTogether) {
    jobs.push_back(std::move(waiting_.front()));
    waiting_.pop_front();
  }
  return jobs;
}

void CommitThread::Answer(std::vector<Job> jobs) {
  std::vector<absl::Status> answers(jobs.size());
  // One that finds the disk full takes the others with it; by itself each gets what is its own.
  if (jobs.size() == 1 || !CommitTogether(jobs, &answers).ok()) {
    for (size_t i = 0; i < jobs.size(); ++i) answers[i] = CommitAlone(jobs[i]);
  }
  const absl::Status check = check_();
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (answers[i].ok()) answers[i] = check;
    if (answers[i].ok() && jobs[i].after) answers[i] = jobs[i].after(*database_);
    log_holds_erased_ = log_holds_erased_ || (answers[i].ok() && jobs[i].erases);
  }
  if (log_holds_erased_) TruncateLog();
  for (size_t i = 0; i < jobs.size(); ++i) {
    latency_.Observe(std::chrono::steady_clock::now() - jobs[i].submitted);
    if (jobs[i].done) jobs[i].done(std::move(answers[i]));
  }
}

absl::Status CommitThread::CommitTogether(std::vector<Job>& jobs,
                                          std::vector<absl::Status>* answers) {
  const absl::Status status = [&]() -> absl::Status {
    TF_RETURN_IF_ERROR(database_->Execute("BEGIN IMMEDIATE"));
    for (size_t i = 0; i < jobs.size(); ++i) {
      TF_RETURN_IF_ERROR(database_->Execute("SAVEPOINT job"));
      absl::Status& answer = (*answers)[i];
      answer = jobs[i].work(*database_);
      // SQLite ends the whole transaction itself after some errors.
      if (!database_->in_transaction()) return answer;
      if (!answer.ok()) TF_RETURN_IF_ERROR(database_->Execute("ROLLBACK TO job"));
      TF_RETURN_IF_ERROR(database_->Execute("RELEASE job"));
    }
    TF_FAULT_POINT("commit.before_group");
    TF_RETURN_IF_ERROR(database_->Execute("COMMIT"));
    TF_FAULT_POINT("commit.after_group");
    return absl::OkStatus();
  }();
  if (database_->in_transaction()) database_->Execute("ROLLBACK").IgnoreError();
  return status;
}

absl::Status CommitThread::CommitAlone(Job& job) {
  TF_RETURN_IF_ERROR(database_->Execute("BEGIN IMMEDIATE"));
  absl::Status status = job.work(*database_);
  TF_FAULT_POINT("commit.before");
  if (status.ok()) status = database_->Execute("COMMIT");
  TF_FAULT_POINT("commit.after");
  if (database_->in_transaction()) database_->Execute("ROLLBACK").IgnoreError();
  return status;
}

void CommitThread::TruncateLog() {
  TF_FAULT_POINT("commit.before_truncation");
  absl::StatusOr<bool> truncated = false;
  {
    MutexLock lock(reader_mutex_);
    truncated = database_->TruncateLog();
  }
  TF_FAULT_POINT("commit.truncated");
  log_holds_erased_ = !truncated.ok() || !*truncated;
}

}  // namespace tissueform
