// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/session/deadline_timer.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// Asks at every period whether the caller of a stream may go on.
//
// Thread-safe.
class StreamAuthorization {
 public:
  // Waits for the store and may outlive the stream, so it holds copies of what it needs.
  using Question = std::function<absl::Status()>;
  // Makes the question, on the timer's thread. Empty: nothing to ask this time.
  using MakeQuestion = std::function<Question()>;
  // Gets the first status that is not OK, in Lane::kLeases; nothing is asked after that.
  using End = std::function<void(const absl::Status& status)>;

  // `make` and `end` are called without a lock of this object. `timer` and `pool` must outlive it.
  StreamAuthorization(DeadlineTimer* timer, WorkerPool* pool, std::chrono::milliseconds period,
                      MakeQuestion make, End end);

  void Start();
  // Once it has returned, nothing is called any more; a question that waits for the store is not
  // waited for. Not with a lock held that `make` or `end` takes. Also where it was not started.
  void Stop();

 private:
  // Questions hold it, too.
  struct State {
    Mutex mutex;  // innermost but for the timer's
    ConditionVariable answered;
    bool stopped ABSL_GUARDED_BY(mutex) = false;
    bool calling ABSL_GUARDED_BY(mutex) = false;  // `end`, or the next start
    DeadlineTimer::Id next ABSL_GUARDED_BY(mutex);
  };

  void Ask();
  void TakeAnswer(const absl::Status& status);

  DeadlineTimer* const timer_;
  WorkerPool* const pool_;
  const std::chrono::milliseconds period_;
  const MakeQuestion make_;
  const End end_;
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace tissueform
