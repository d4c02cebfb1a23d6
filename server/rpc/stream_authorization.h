// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/session/deadline_timer.h"

namespace tissueform {

// Asks at every period whether the caller of a stream may go on.
//
// Thread-safe.
class StreamAuthorization {
 public:
  // Both are called on the timer's thread, without a lock of this object. `check` is OK while the
  // caller may go on. `end` gets the first other status, and nothing is asked after that.
  using Check = std::function<absl::Status()>;
  using End = std::function<void(const absl::Status& status)>;

  // `timer` must outlive it.
  StreamAuthorization(DeadlineTimer* timer, std::chrono::milliseconds period, Check check, End end);

  void Start() ABSL_LOCKS_EXCLUDED(mutex_);
  // Once it has returned, nothing is asked any more. Not with a lock held that `check` or `end`
  // takes. Also where it was not started.
  void Stop() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void Recheck() ABSL_LOCKS_EXCLUDED(mutex_);

  DeadlineTimer* const timer_;
  const std::chrono::milliseconds period_;
  const Check check_;
  const End end_;

  Mutex mutex_;  // innermost but for the timer's
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
  DeadlineTimer::Id next_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
