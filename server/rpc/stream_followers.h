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
  using OnCount = std::function<void(int count)>;

  // `timer` must outlive it.
  StreamFollowers(DeadlineTimer* timer, OnCount on_count);

  void FollowersChanged(int count) override ABSL_LOCKS_EXCLUDED(mutex_);

  // Once it has returned, `on_count` neither runs nor will. Not with a lock held that `on_count`
  // takes.
  // REQUIRES: no channel knows it any more.
  void Stop() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void ReportNews() ABSL_LOCKS_EXCLUDED(mutex_);

  DeadlineTimer* const timer_;
  const OnCount on_count_;

  Mutex mutex_;  // innermost but for the timer's
  int count_ ABSL_GUARDED_BY(mutex_) = 0;
  int reported_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_due_ ABSL_GUARDED_BY(mutex_) = false;  // a call of ReportNews is under way
  DeadlineTimer::Id due_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
