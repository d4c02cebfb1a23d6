// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"

#include "server/rpc/stream_answers.h"
#include "server/session/deadline_timer.h"
#include "server/session/frame_scheduler.h"
#include "server/session/session.h"

// How the poses of a Deform stream are answered on the workers, without the stream.
namespace tissueform {

// The stream, as the jobs of its drag see it. Called from the workers, without a lock held. It
// lives until FinishAnswer was called.
class DragHost {
 public:
  // What is to be answered now, the newest pose or the one that an estimate has answered. Empty
  // when the stream has ended.
  virtual std::optional<WaitingPose> TakeNewest() = 0;
  virtual std::optional<WaitingPose> TakeEstimated() = 0;
  // What to do with an answer that is not the last one; kStop when the stream has ended.
  virtual FrameScheduler::EarlyAnswer JudgeEarly() = 0;
  virtual void OfferEarly(AnswerFrame frame) = 0;
  // The end of the job. `pose` is what `answer` answers; both are empty where nothing was taken.
  virtual void FinishAnswer(const Session& session, std::optional<WaitingPose> pose,
                            absl::StatusOr<std::optional<AnswerFrame>> answer) = 0;

 protected:
  ~DragHost() = default;
};

// Each posts one job, which ends with FinishAnswer.
//
// Answers the newest pose: in the lane of frames where `claim`, which may be null, covers it, else
// by a solve on the session's strand.
void PostAnswer(DragHost* host, std::shared_ptr<const StreamConfiguration> configuration,
                std::shared_ptr<PreparedAnswersRef> claim);
// Works out what an estimate has answered, on the session's strand.
void PostRefinement(DragHost* host, std::shared_ptr<const StreamConfiguration> configuration);

// How long the hand has rested since the last estimate. Its owner guards it.
class DragRest {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  // After this time without a newer pose an estimate is worked out. Longer than poses of a drag are
  // apart; a shorter time would take a processor from other drags for answers that are not needed.
  static constexpr std::chrono::milliseconds kRest{150};

  // `look` is called on the timer's thread when the rest may be over; it calls EndWait. `timer`
  // must outlive this object.
  DragRest(DeadlineTimer* timer, std::function<void()> look);

  // An estimate was made.
  void Begin(TimePoint now);
  bool IsOver(TimePoint now) const { return now >= since_ + kRest; }
  // From `look`. True when the rest is over. Where a newer estimate was made in between it waits
  // for the rest of the time, if the owner still has an estimate (`is_needed`).
  bool EndWait(TimePoint now, bool is_needed);
  // What the owner cancels, without its lock, when it ends.
  DeadlineTimer::Id wait() const { return wait_; }

 private:
  DeadlineTimer* const timer_;
  const std::function<void()> look_;
  TimePoint since_;
  DeadlineTimer::Id wait_;  // Id(): nothing is waited for
};

}  // namespace tissueform
