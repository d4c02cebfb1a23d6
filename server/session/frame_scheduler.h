// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

#include "core/base/duration_histogram.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/deformer.h"

namespace tissueform {

// A pose that waits for its turn.
struct WaitingPose {
  uint64_t sequence = 0;
  int64_t coalesced_count = 0;  // poses that it replaced
  std::vector<HandlePose> poses;
  std::chrono::steady_clock::time_point arrived = {};
};

// What the drags of a server have done, for monitoring. Thread-safe.
struct FrameMeasures {
  std::atomic<int64_t> poses = 0;
  std::atomic<int64_t> coalesced_poses = 0;  // replaced by a newer one before they were answered
  std::atomic<int64_t> frames = 0;           // taken to be written
  DurationHistogram latency;                 // of each: since its pose came
  DurationHistogram picture_age;  // since the pose of a frame came, when the client has used it
};

// An answer to a pose, on its way to the client.
struct AnswerFrame {
  uint64_t sequence = 0;
  int64_t coalesced_count = 0;
  int32_t refinement = 0;  // numbered by FrameScheduler
  bool refining = false;
  SolveSummary summary;
  std::string positions;  // as they are sent
  double step_mm = 0;     // of their encoding, where it has one
  std::string band = {};  // DeformFrame.uncertainty_p95_mm
};

// What may be solved and sent next in a drag: a mailbox for the newest pose, and credits for the
// frames on their way. No threads and no transport: its owner asks it after every event, and guards
// it.
//
// A solve goes StartSolve, TakePose, any number of early answers, FinishSolve.
class FrameScheduler {
 public:
  // At most `max_unacked` frames are on their way without acknowledgement.
  // `measures`, which may be null, must outlive it.
  explicit FrameScheduler(size_t max_unacked, FrameMeasures* measures = nullptr)
      : max_unacked_(max_unacked), measures_(measures) {}

  // The client. A pose replaces the one that waits. Errors: InvalidArgument when `sequence` does
  // not rise.
  absl::Status Put(uint64_t sequence, std::vector<HandlePose> poses);
  // Of the frame with this refinement and all before it; of all frames of the pose when left out.
  // Errors: InvalidArgument for a frame that was not made.
  absl::Status Acknowledge(uint64_t sequence, std::optional<int32_t> refinement);
  // No more poses and acknowledgements will come: the newest pose needs no credit.
  void CloseSending() { closed_ = true; }

  // While something is prepared no solve starts.
  void StartPreparation() { busy_ = true; }
  void FinishPreparation() { busy_ = false; }

  // True when a pose waits, there is a credit, and neither another solve is under way nor a frame
  // waits for its write (a newer pose may still come for the next one): a solve is under way then.
  bool StartSolve();
  // The newest pose at this moment. REQUIRES: StartSolve was true.
  std::optional<WaitingPose> TakePose() { return StartOn(std::exchange(mailbox_, std::nullopt)); }
  // A pose that was taken and could not be answered, to be answered later unless a newer one waits.
  void PutBack(WaitingPose pose);
  // The answer, or nothing if the solve has no answer. One whose solve was given up
  // (summary.cancelled) is kept only when it is the first to its pose: better than nothing.
  void FinishSolve(std::optional<AnswerFrame> frame);
  // An answer that is `refining`, and what it answers, to be worked out when no newer pose comes.
  void FinishEstimate(AnswerFrame frame, WaitingPose pose);

  // As StartSolve, for the pose of an estimate. Until the client has closed that is worth its while
  // only when the hand rests: `at_rest`.
  bool StartRefinement(bool at_rest);
  // REQUIRES: StartRefinement was true.
  std::optional<WaitingPose> TakeRefinement() {
    return StartOn(std::exchange(estimated_, std::nullopt));
  }
  bool has_estimate() const { return estimated_.has_value(); }

  // What to do with an answer that is not the last one to its pose.
  enum class EarlyAnswer {
    kShow,  // OfferEarly
    kSkip,  // go on solving; the last credit is kept for the last answer
    kStop,  // a newer pose waits
  };
  EarlyAnswer JudgeEarly() const;
  void OfferEarly(AnswerFrame frame);

  // The frame that is to be written now, if any.
  std::optional<AnswerFrame> TakeFrame();

  // Something is prepared or solved.
  bool busy() const { return busy_; }
  // The client has closed and everything was answered and taken.
  bool Done() const {
    return closed_ && !busy_ && !mailbox_.has_value() && !frame_.has_value() && !has_estimate();
  }

 private:
  // Sequence of the pose and how often it was refined; frames go out in rising order.
  using FrameNumber = std::pair<uint64_t, int32_t>;
  using TimePoint = std::chrono::steady_clock::time_point;
  struct SentFrame {
    FrameNumber number;
    TimePoint pose_arrived;
  };

  // The pose that is answered from now on.
  std::optional<WaitingPose> StartOn(std::optional<WaitingPose> pose);

  // Neither is something under way, nor does a frame wait, and there is a credit.
  bool MayStart() const;
  // Frames of `sequence` made so far.
  int32_t CountFrames(uint64_t sequence) const;
  // A frame waits for its write; it replaces an earlier answer to the same pose that still waits.
  void Offer(AnswerFrame frame);

  const size_t max_unacked_;
  FrameMeasures* const measures_;

  std::optional<uint64_t> last_sequence_;
  std::optional<WaitingPose> mailbox_;
  std::optional<WaitingPose> estimated_;  // answered by an estimate only
  std::deque<SentFrame> unacked_;         // frames made and not acknowledged, rising
  TimePoint pose_arrived_;                // of the pose that is or was answered last
  std::optional<FrameNumber> last_frame_;
  std::optional<AnswerFrame> frame_;
  bool busy_ = false;
  bool closed_ = false;
};

}  // namespace tissueform
