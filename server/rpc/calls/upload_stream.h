// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// A call that takes something in messages, piece by piece. Deletes itself when gRPC is done with
// it.
//
// A good answer waits for the client to end its stream, or to send nothing for kEndPatience, for
// kMaxEndPatience in all, and what it still sends is dropped: HAProxy resets the stream of a call
// that is answered before, and clients may lose the answer to that. Errors are not waited with: who
// is refused is to stop sending, and code and words arrive in the details (docs/scaling.md).
//
// One thing at a time is under way: a read, or a job on a worker that takes what was read, checks
// the whole or ends the call. So no message is read before the one before is written, and no thread
// of gRPC waits for the disk. Beside it runs only the timer, which gives a silent client up.
template <typename Request>
class UploadStream : public grpc::ServerReadReactor<Request> {
 public:
  // Once, when it is made.
  void Start() {
    MutexLock lock(mutex_);
    if (scope_.admission().ok()) {
      Read();
      WaitForMore(last_heard_ + silence_);
    } else {
      state_ = State::kEnded;
      this->Finish(scope_.End(scope_.admission()));
    }
  }

  void OnReadDone(bool ok) override {
    MutexLock lock(mutex_);
    if (state_ == State::kEnded) return;  // the client was silent for too long
    if (state_ == State::kAnswered) {
      if (ok && std::chrono::steady_clock::now() < last_end_) {
        Read();
      } else {
        EndWell();
      }
    } else if (ok) {
      state_ = State::kWorking;
      pool_->Post(Lane::kStore, [this] { TakeMessage(); });
    } else {
      PostEnd(EndedEarly());
    }
  }

  void OnDone() override {
    std::pair<DeadlineTimer::Id, DeadlineTimer::Id> deadlines;
    {
      MutexLock lock(mutex_);  // the thread that called Finish may still hold it
      deadlines = {deadline_, answer_deadline_};
    }
    timer_->Cancel(deadlines.first);
    timer_->Cancel(deadlines.second);
    delete this;
  }

 protected:
  // `check_lane`: where Check works. `pool` and `timer` must outlive the call.
  UploadStream(CallScope scope, std::chrono::milliseconds silence, Lane check_lane,
               WorkerPool* pool, DeadlineTimer* timer)
      : scope_(std::move(scope)),
        silence_(silence),
        check_lane_(check_lane),
        pool_(pool),
        timer_(timer) {}
  ~UploadStream() override = default;

  const CallScope& scope() const { return scope_; }
  CallScope& scope() { return scope_; }  // of jobs
  std::chrono::milliseconds silence() const { return silence_; }

  // What comes after a message.
  enum class After { kMore, kCheck, kEnd };
  // Of one message; on a worker, may block on the disk.
  virtual absl::StatusOr<After> Take(const Request& request) = 0;
  // Of all that has come. On a worker.
  virtual absl::Status Check() = 0;
  // Releases what has come, so that the client may start again when it hears of the end. On a
  // worker.
  virtual void Close() = 0;
  // How the call ends whose client sends no more, or says nothing. No job is under way then.
  virtual absl::Status EndedEarly() const = 0;
  virtual absl::Status WasSilent() const = 0;

 private:
  enum class State { kReading, kWorking, kAnswered, kEnded };
  static constexpr std::chrono::milliseconds kEndPatience{1000};
  static constexpr std::chrono::milliseconds kMaxEndPatience{5000};

  void Read() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    last_heard_ = std::chrono::steady_clock::now();
    this->StartRead(&request_);
  }

  // Jobs. What comes next is decided by the last thing a job does.
  void TakeMessage() ABSL_LOCKS_EXCLUDED(mutex_) {
    const absl::StatusOr<After> after = Take(request_);
    if (!after.ok() || *after == After::kEnd) {
      End(after.status());
      return;
    }
    MutexLock lock(mutex_);
    if (*after == After::kCheck) {
      pool_->Post(check_lane_, [this] { End(Check()); });
    } else {
      state_ = State::kReading;
      Read();
    }
  }
  void End(const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex_) {
    Close();
    MutexLock lock(mutex_);
    if (outcome.ok()) {
      state_ = State::kAnswered;
      last_end_ = std::chrono::steady_clock::now() + std::min(silence_, kMaxEndPatience);
      Read();
      WaitForEnd();
    } else {
      state_ = State::kEnded;
      this->Finish(scope_.End(outcome));
    }
  }
  void EndWell() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    state_ = State::kEnded;
    this->Finish(scope_.End(absl::OkStatus()));
  }
  void PostEnd(absl::Status outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    state_ = State::kEnded;
    pool_->Post(Lane::kStore, [this, outcome = std::move(outcome)] { End(outcome); });
  }

  // On the timer's thread.
  void EndIfSilent() ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    if (state_ == State::kAnswered || state_ == State::kEnded) return;
    const DeadlineTimer::TimePoint now = std::chrono::steady_clock::now();
    // While a job works the client is not waited for.
    const DeadlineTimer::TimePoint until =
        (state_ == State::kWorking ? now : last_heard_) + silence_;
    if (now < until) {
      WaitForMore(until);
    } else {
      PostEnd(WasSilent());
    }
  }
  void WaitForMore(DeadlineTimer::TimePoint until) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    deadline_ = timer_->Start(until, [this] { EndIfSilent(); });
  }

  void EndIfAtRest() ABSL_LOCKS_EXCLUDED(mutex_) {
    MutexLock lock(mutex_);
    if (state_ != State::kAnswered) return;
    if (std::chrono::steady_clock::now() < RestsAt()) {
      WaitForEnd();
    } else {
      EndWell();
    }
  }
  void WaitForEnd() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    answer_deadline_ = timer_->Start(RestsAt(), [this] { EndIfAtRest(); });
  }
  DeadlineTimer::TimePoint RestsAt() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return last_heard_ + std::min(silence_, kEndPatience);
  }

  CallScope scope_;

  // Constant.
  const std::chrono::milliseconds silence_;
  const Lane check_lane_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;

  Request request_;  // gRPC's while a read is under way, else the job's

  Mutex mutex_;
  State state_ ABSL_GUARDED_BY(mutex_) = State::kReading;
  DeadlineTimer::TimePoint last_heard_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::TimePoint last_end_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::Id deadline_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::Id answer_deadline_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
