// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_drag.h"

#include <utility>

#include "server/session/worker_pool.h"

namespace tissueform {
namespace {

using Configuration = std::shared_ptr<const StreamConfiguration>;
using Answer = absl::StatusOr<std::optional<AnswerFrame>>;
using EarlyAnswer = FrameScheduler::EarlyAnswer;

bool ShowEarly(DragHost* host, const MakeFrame& make_frame) {
  const EarlyAnswer judgement = host->JudgeEarly();
  // Without the stream's lock: it encodes all vertices.
  if (judgement == EarlyAnswer::kShow) host->OfferEarly(make_frame());
  return judgement != EarlyAnswer::kStop;
}

void Solve(DragHost* host, const StreamConfiguration& configuration,
           std::optional<WaitingPose> pose) {
  Answer answer = std::optional<AnswerFrame>();
  if (pose.has_value()) {
    answer = SolvePose(configuration, *pose,
                       [host](const MakeFrame& make_frame) { return ShowEarly(host, make_frame); });
  }
  host->FinishAnswer(*configuration.session, std::move(pose), std::move(answer));
}

void AnswerNewest(DragHost* host, const Configuration& configuration,
                  const PreparedAnswersRef& claim) {
  std::optional<WaitingPose> pose = host->TakeNewest();
  Answer answer = std::optional<AnswerFrame>();
  if (pose.has_value()) answer = AnswerFromPrepared(*configuration, claim, *pose);
  Session& session = *configuration->session;
  if (!pose.has_value() || !answer.ok() || answer->has_value()) {
    host->FinishAnswer(session, std::move(pose), std::move(answer));
    return;
  }
  // Not covered. The pose goes along: what is under way is this pose's answer.
  session.strand().Post(
      session.LaneOf(configuration->model),
      [host, configuration, pose = std::move(pose)] { Solve(host, *configuration, pose); });
}

void Refine(DragHost* host, const StreamConfiguration& configuration) {
  std::optional<WaitingPose> pose = host->TakeEstimated();
  Answer answer = std::optional<AnswerFrame>();
  if (pose.has_value()) {
    // Early answers begin with the linear one, which is worse than the estimate that is there.
    answer = SolvePose(configuration, *pose, [host](const MakeFrame& /*make_frame*/) {
      return host->JudgeEarly() != EarlyAnswer::kStop;
    });
  }
  host->FinishAnswer(*configuration.session, std::move(pose), std::move(answer));
}

}  // namespace

void PostAnswer(DragHost* host, Configuration configuration,
                std::shared_ptr<PreparedAnswersRef> claim) {
  Session& session = *configuration->session;
  if (claim != nullptr) {
    session.pool().Post(Lane::kFrames,
                        [host, configuration = std::move(configuration), claim = std::move(claim)] {
                          AnswerNewest(host, configuration, *claim);
                        });
  } else {
    const Lane lane = session.LaneOf(configuration->model);
    session.strand().Post(lane, [host, configuration = std::move(configuration)] {
      Solve(host, *configuration, host->TakeNewest());
    });
  }
}

void PostRefinement(DragHost* host, Configuration configuration) {
  Session& session = *configuration->session;
  session.strand().Post(Lane::kIterations, [host, configuration = std::move(configuration)] {
    Refine(host, *configuration);
  });
}

DragRest::DragRest(DeadlineTimer* timer, std::function<void()> look)
    : timer_(timer), look_(std::move(look)) {}

void DragRest::Begin(TimePoint now) {
  since_ = now;
  if (wait_ != DeadlineTimer::Id()) return;  // EndWait finds how long the hand has rested
  wait_ = timer_->Start(since_ + kRest, look_);
}

bool DragRest::EndWait(TimePoint now, bool is_needed) {
  wait_ = DeadlineTimer::Id();
  if (!is_needed) return false;
  if (IsOver(now)) return true;
  wait_ = timer_->Start(since_ + kRest, look_);
  return false;
}

}  // namespace tissueform
