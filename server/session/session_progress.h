// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/mutex.h"
#include "core/base/preparation_progress.h"
#include "server/session/clock.h"

namespace tissueform {

// What a session goes through until it is ready, in this order; what it does not need is left out.
enum class SessionStage {
  kReadingMesh,
  kWaiting,  // until a worker is free, and what was begun earlier for others is done
  // Those of PreparationStage.
  kAssembling,
  kOrdering,
  kFactorising,
  kResponses,
  kKeeping,  // its record is written
  kAnswers,  // of PreparationStage, for a stream that is to come
};

struct SessionProgress {
  SessionStage stage = SessionStage::kReadingMesh;
  int64_t step = 0;   // so many are done
  int64_t steps = 0;  // of so many; 0: the stage does not count

  friend bool operator==(const SessionProgress&, const SessionProgress&) = default;
};

SessionProgress ToSessionProgress(const PreparationProgress& progress);

// Called from any thread, also when its client no longer listens: short, and it must not block. May
// be empty.
using SessionProgressCallback = std::function<void(const SessionProgress& progress)>;

// From what is made in one place to all who wait for it. One thing is made at a time; each has a
// topic, a number by which those who wait say what they wait for.
//
// Begin, Report and End by one thread at a time; Follow from any.
class ProgressFeed {
 public:
  struct Follower;

  // Hears of the topic for as long as the result lives, and at once how far it is where it is being
  // made. Null where `on_progress` is empty.
  std::shared_ptr<const Follower> Follow(size_t topic, SessionProgressCallback on_progress);

  void Begin(size_t topic);
  // Followers only receive it between Begin and End.
  void Report(const SessionProgress& progress);
  void End();

 private:
  Mutex mutex_;
  std::vector<std::weak_ptr<const Follower>> followers_ ABSL_GUARDED_BY(mutex_);
  std::optional<size_t> topic_ ABSL_GUARDED_BY(mutex_);
  std::optional<SessionProgress> newest_ ABSL_GUARDED_BY(mutex_);
};

// The part of its progress that a call receives: every stage, but no more than about five steps a
// second of a stage that counts. Nothing goes back: if another client's call ended in the middle,
// its steps are done again without being shown.
//
// One thread at a time.
class ProgressPace {
 public:
  static constexpr std::chrono::milliseconds kInterval{200};

  // `clock` must outlive it.
  explicit ProgressPace(const Clock* clock) : clock_(clock) {}

  void Offer(const SessionProgress& progress);
  // What to send now; empty: nothing.
  std::optional<SessionProgress> Take();

 private:
  const Clock* const clock_;
  std::optional<SessionProgress> newest_;
  std::optional<SessionProgress> reported_;
  Clock::TimePoint reported_at_;
};

}  // namespace tissueform
