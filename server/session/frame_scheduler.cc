// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/frame_scheduler.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"

namespace tissueform {

absl::Status FrameScheduler::Put(uint64_t sequence, std::vector<HandlePose> poses) {
  if (last_sequence_.has_value() && sequence <= *last_sequence_) {
    return WithReason(
        absl::InvalidArgumentError(absl::StrCat("sequence ", sequence, " after ", *last_sequence_,
                                                "; sequences must rise from pose to pose")),
        ErrorReason::kPoseSequenceNotRising);
  }
  const int64_t coalesced_count = mailbox_.has_value() ? mailbox_->coalesced_count + 1 : 0;
  mailbox_ = {sequence, coalesced_count, std::move(poses), std::chrono::steady_clock::now()};
  if (measures_ != nullptr) {
    ++measures_->poses;
    if (coalesced_count > 0) ++measures_->coalesced_poses;
  }
  last_sequence_ = sequence;
  estimated_.reset();
  return absl::OkStatus();
}

absl::Status FrameScheduler::Acknowledge(uint64_t sequence, std::optional<int32_t> refinement) {
  const FrameNumber acknowledged(sequence,
                                 refinement.value_or(std::max(0, CountFrames(sequence) - 1)));
  if (!last_frame_.has_value() || acknowledged > *last_frame_) {
    return absl::InvalidArgumentError(
        absl::StrCat("ack of frame ", sequence, ", refinement ", acknowledged.second,
                     ", which was not sent; acknowledge frames that arrived"));
  }
  while (!unacked_.empty() && unacked_.front().number <= acknowledged) {
    if (measures_ != nullptr && unacked_.front().number == acknowledged) {
      measures_->picture_age.Observe(std::chrono::steady_clock::now() -
                                     unacked_.front().pose_arrived);
    }
    unacked_.pop_front();
  }
  return absl::OkStatus();
}

bool FrameScheduler::MayStart() const {
  const bool has_credit = closed_ || unacked_.size() < max_unacked_;
  return !busy_ && !frame_.has_value() && has_credit;
}

bool FrameScheduler::StartSolve() {
  if (!mailbox_.has_value() || !MayStart()) return false;
  busy_ = true;
  return true;
}

bool FrameScheduler::StartRefinement(bool at_rest) {
  if (!has_estimate() || mailbox_.has_value() || !(at_rest || closed_) || !MayStart()) return false;
  busy_ = true;
  return true;
}

void FrameScheduler::PutBack(WaitingPose pose) {
  if (mailbox_.has_value()) {
    mailbox_->coalesced_count += pose.coalesced_count + 1;
    if (measures_ != nullptr) ++measures_->coalesced_poses;
  } else {
    mailbox_ = std::move(pose);
  }
}

void FrameScheduler::FinishSolve(std::optional<AnswerFrame> frame) {
  busy_ = false;
  if (!frame.has_value()) return;
  if (frame->summary.cancelled && CountFrames(frame->sequence) > 0) return;
  Offer(*std::move(frame));
}

FrameScheduler::EarlyAnswer FrameScheduler::JudgeEarly() const {
  if (mailbox_.has_value()) return EarlyAnswer::kStop;
  const bool has_spare_credit = unacked_.size() + 1 < max_unacked_;
  return frame_.has_value() || !has_spare_credit ? EarlyAnswer::kSkip : EarlyAnswer::kShow;
}

void FrameScheduler::OfferEarly(AnswerFrame frame) {
  frame.refining = true;
  Offer(std::move(frame));
}

void FrameScheduler::FinishEstimate(AnswerFrame frame, WaitingPose pose) {
  busy_ = false;
  if (!mailbox_.has_value()) estimated_ = std::move(pose);
  frame.refining = true;
  Offer(std::move(frame));
}

std::optional<WaitingPose> FrameScheduler::StartOn(std::optional<WaitingPose> pose) {
  if (pose.has_value()) pose_arrived_ = pose->arrived;
  return pose;
}

std::optional<AnswerFrame> FrameScheduler::TakeFrame() {
  if (frame_.has_value() && measures_ != nullptr) {
    ++measures_->frames;
    measures_->latency.Observe(std::chrono::steady_clock::now() - pose_arrived_);
  }
  return std::exchange(frame_, std::nullopt);
}

void FrameScheduler::Offer(AnswerFrame frame) {
  if (frame_.has_value()) {
    // The same pose, and the same credit: nothing else is computed while a frame waits.
    frame.refinement = frame_->refinement;
  } else {
    frame.refinement = CountFrames(frame.sequence);
    last_frame_ = FrameNumber(frame.sequence, frame.refinement);
    unacked_.push_back({*last_frame_, pose_arrived_});
  }
  if (frame.refinement > 0) {
    frame.coalesced_count = 0;  // reported by the first frame of the pose
  }
  frame_ = std::move(frame);
}

int32_t FrameScheduler::CountFrames(uint64_t sequence) const {
  return last_frame_.has_value() && last_frame_->first == sequence ? last_frame_->second + 1 : 0;
}

}  // namespace tissueform
