// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <optional>

#include "absl/status/status.h"

#include "core/base/backoff.h"
#include "core/base/mutex.h"

namespace tissueform {

// How a stream comes back that broke: a drag, a watch. One thread attaches; Cancel, cancelled and
// count may be called from others.
class Reattachment {
 public:
  struct Options {
    Backoff::Options backoff = {};
    // A stream that ends sooner has come to nothing: waits go on growing from where they were.
    std::chrono::milliseconds lasting{2'000};
    // Without a stream for so long it ends, with the last error.
    std::chrono::milliseconds give_up_after{60'000};
    // The stream broke, and it goes on.
    std::function<void(const absl::Status& why)> on_detached = nullptr;
    std::function<void()> on_reattached = nullptr;
  };

  explicit Reattachment(Options options);

  // Calls `open` until it is OK: at once when the session has moved to another server after a
  // stream that lasted, else after a wait, and with waits in between.
  //
  // Errors: `why`, or that of the last attempt, when another stream would not do better, when it
  // was cancelled and when time is up.
  absl::Status After(absl::Status why, const std::function<absl::Status()>& open);

  // Ends a wait at once; there are no more attempts.
  void Cancel();
  bool cancelled() const { return cancelled_; }
  // How often it came back.
  int count() const { return count_; }

 private:
  // The previous stream has ended: resets the waits if it lasted long enough.
  void JudgeLastStream();
  // False when canceled during the wait.
  bool Wait(std::chrono::milliseconds time) ABSL_LOCKS_EXCLUDED(mutex_);

  const Options options_;

  // The attaching thread's.
  Backoff backoff_;
  bool may_be_at_once_ = true;
  std::optional<std::chrono::steady_clock::time_point> attached_at_;  // since the first loss

  // Self-synchronised.
  std::atomic<bool> cancelled_ = false;  // set under the mutex, so that no wait misses it
  std::atomic<int> count_ = 0;

  Mutex mutex_;
  ConditionVariable changed_;
};

}  // namespace tissueform
