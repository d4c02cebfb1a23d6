// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "core/base/mutex.h"
#include "server/rpc/watches/watch_channel.h"
#include "server/session/deadline_timer.h"

namespace tissueform {

// Reports to a drag how many watch it. The channel reports changes under locks that come after the
// drag's own, so this class passes them on from the timer's thread.
//
// Thread-safe.
class StreamFollowers final : public Dragger {
 public:
  // On the timer's thread, without a lock held; each time another number than before, at first not
  // 0.
  using Tell = std::function<void(int count)>;

  // `timer` must outlive it.
  StreamFollowers(DeadlineTimer* timer, Tell tell);

  void FollowersChanged(int count) override ABSL_LOCKS_EXCLUDED(mutex_);

  // Once it has returned, `tell` neither runs nor will. Not with a lock held that `tell` takes.
  // REQUIRES: no channel knows it any more.
  void Stop() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void TellNews() ABSL_LOCKS_EXCLUDED(mutex_);

  DeadlineTimer* const timer_;
  const Tell tell_;

  Mutex mutex_;  // innermost but for the timer's
  int count_ ABSL_GUARDED_BY(mutex_) = 0;
  int told_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_due_ ABSL_GUARDED_BY(mutex_) = false;  // a call of TellNews is under way
  DeadlineTimer::Id due_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
