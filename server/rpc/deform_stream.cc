// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_stream.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"

namespace tissueform {

DeformStreamReactor::DeformStreamReactor(CallScope scope, const ServiceLimits& limits,
                                         SessionRegistry* registry, DeformStreams* streams,
                                         DeadlineTimer* timer)
    : scope_(std::move(scope)),
      limits_(limits),
      registry_(registry),
      streams_(streams),
      timer_(timer) {
  absl::Status admission = scope_.admission();
  if (admission.ok()) {
    admission = streams_->Add(this);
    registered_ = admission.ok();
  }
  MutexLock lock(mutex_);
  if (admission.ok()) {
    deadline_ = timer_->Start(std::chrono::steady_clock::now() + limits_.configuration_deadline,
                              [this] { EndUnlessConfigured(); });
    StartRead(&request_);
  } else {
    End(admission);
    Advance();
  }
}

void DeformStreamReactor::OnReadDone(bool ok) {
  MutexLock lock(mutex_);
  if (!ok) {
    if (flow_.has_value()) {
      flow_->CloseSending();
    } else {
      End(absl::InvalidArgumentError("the stream ended before its configuration; send that first"));
    }
  } else if (!outcome_.has_value()) {
    if (const absl::Status status = Take(); !status.ok()) {
      End(status);
    } else {
      StartRead(&request_);
    }
  }
  Advance();
}

void DeformStreamReactor::OnWriteDone(bool ok) {
  MutexLock lock(mutex_);
  write_in_flight_ = false;
  if (!ok) {
    End(absl::CancelledError("the client is gone"));
  }
  Advance();
}

void DeformStreamReactor::OnCancel() {
  MutexLock lock(mutex_);
  End(absl::CancelledError("the client has cancelled the stream"));
  Advance();
}

void DeformStreamReactor::EndUnlessConfigured() {
  MutexLock lock(mutex_);
  if (configuration_ != nullptr) return;
  // A silent stream holds one of the places that others wait for.
  End(WithReason(absl::DeadlineExceededError(absl::StrCat(
                     "no configuration came within ", limits_.configuration_deadline.count(),
                     " ms of the opening of the stream; send it as the first message")),
                 ErrorReason::kNoConfigurationInTime));
  Advance();
}

void DeformStreamReactor::OnDone() {
  if (registered_) {
    streams_->Remove(this);
    timer_->Cancel(deadline_);
  }
  {
    MutexLock lock(mutex_);  // whoever called Finish may still hold it
  }
  delete this;
}

void DeformStreamReactor::NotifyDraining() {
  MutexLock lock(mutex_);
  tell_draining_ = true;
  Advance();
}

absl::Status DeformStreamReactor::Take() {
  if (configuration_ == nullptr) {
    return TakeConfiguration();
  }
  switch (request_.message_case()) {
    case v1::DeformRequest::kPose:
      return TakePose(request_.pose());
    case v1::DeformRequest::kAck: {
      const v1::FrameAck& ack = request_.ack();
      return flow_->Acknowledge(ack.sequence(), ack.has_refinement()
                                                    ? std::optional<int32_t>(ack.refinement())
                                                    : std::nullopt);
    }
    case v1::DeformRequest::kConfiguration:
      return absl::InvalidArgumentError("a second configuration; open another stream for it");
    case v1::DeformRequest::MESSAGE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("a message without content; send a pose or an ack");
}

absl::Status DeformStreamReactor::TakeConfiguration() {
  if (!request_.has_configuration()) {
    return absl::InvalidArgumentError("the first message must be the configuration");
  }
  TF_ASSIGN_OR_RETURN(configuration_,
                      ReadConfiguration(request_.configuration(), limits_, registry_));
  flow_.emplace(configuration_->max_unacked);
  if (configuration_->NeedsPreparation()) {
    flow_->StartPreparation();
    configuration_->session->making_strand().Post(
        Lane::kBatch, [this, configuration = configuration_] { Prepare(*configuration); });
  } else {
    started_ = BeginWithoutPreparation(*configuration_).started;
  }
  return absl::OkStatus();
}

absl::Status DeformStreamReactor::TakePose(const v1::PoseUpdate& update) {
  TF_RETURN_IF_ERROR(flow_->CheckSequence(update.sequence()));
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses,
                      ToPoses(update.poses(), configuration_->session->constraints()));
  return flow_->Put(update.sequence(), std::move(poses));
}

void DeformStreamReactor::End(const absl::Status& outcome) {
  if (!outcome_.has_value()) {
    outcome_ = outcome;
  }
}

void DeformStreamReactor::Advance() {
  if (finished_) {
    return;
  }
  if (!outcome_.has_value() && flow_.has_value()) {
    WriteNext();
    if (flow_->StartSolve()) {
      StartAnswer();
    } else if (flow_->Done() && !write_in_flight_) {
      End(absl::OkStatus());
    }
  }
  const bool busy = write_in_flight_ || (flow_.has_value() && flow_->busy());
  if (outcome_.has_value() && !busy) {
    finished_ = true;
    Finish(scope_.End(*outcome_));
  }
}

void DeformStreamReactor::WriteNext() {
  if (write_in_flight_) {
    return;
  }
  if (std::optional<v1::DeformResponse> next = NextMessage(); next.has_value()) {
    writing_ = *std::move(next);
    write_in_flight_ = true;
    StartWrite(&writing_);
  }
}

std::optional<v1::DeformResponse> DeformStreamReactor::NextMessage() {
  if (started_.has_value()) {
    has_started_ = true;
    return std::exchange(started_, std::nullopt);
  }
  // A notice that comes earlier waits: `started` is the first message.
  if (has_started_ && std::exchange(tell_draining_, false)) {
    v1::DeformResponse notice;
    notice.mutable_notice()->mutable_draining();
    return notice;
  }
  if (std::optional<AnswerFrame> frame = flow_->TakeFrame(); frame.has_value()) {
    return ToProto(*std::move(frame));
  }
  return std::nullopt;
}

void DeformStreamReactor::Prepare(const StreamConfiguration& configuration) {
  absl::StatusOr<StreamBegin> begin =
      PrepareAnswers(configuration, Cancellation([this] { return Ended(); }));
  MutexLock lock(mutex_);
  flow_->FinishPreparation();
  if (begin.ok()) {
    started_ = std::move(begin->started);
    claim_ = std::move(begin->claim);
  } else {
    End(begin.status());
  }
  Advance();
}

void DeformStreamReactor::StartAnswer() {
  Session& session = *configuration_->session;
  if (claim_ != nullptr) {
    session.pool().Post(Lane::kFrames, [this, configuration = configuration_, claim = claim_] {
      AnswerNewest(configuration, claim);
    });
    return;
  }
  session.strand().Post(
      session.LaneOf(configuration_->model),
      [this, configuration = configuration_] { SolveNewest(*configuration, std::nullopt); });
}

std::optional<WaitingPose> DeformStreamReactor::TakePose() {
  MutexLock lock(mutex_);
  return outcome_.has_value() ? std::nullopt : flow_->TakePose();
}

void DeformStreamReactor::AnswerNewest(const Configuration& configuration,
                                       const std::shared_ptr<ResponseClaim>& claim) {
  std::optional<WaitingPose> pose = TakePose();
  absl::StatusOr<std::optional<AnswerFrame>> answer = std::optional<AnswerFrame>();
  if (pose.has_value()) answer = AnswerFromPrepared(*configuration, *claim, *pose);
  if (!pose.has_value() || !answer.ok() || answer->has_value()) {
    FinishAnswer(std::move(answer));
    return;
  }
  // Not covered. The pose goes along: what is under way is this pose's answer.
  Session& session = *configuration->session;
  session.strand().Post(
      session.LaneOf(configuration->model),
      [this, configuration, pose = std::move(pose)] { SolveNewest(*configuration, pose); });
}

void DeformStreamReactor::SolveNewest(const StreamConfiguration& configuration,
                                      std::optional<WaitingPose> pose) {
  if (!pose.has_value()) pose = TakePose();
  absl::StatusOr<std::optional<AnswerFrame>> answer = std::optional<AnswerFrame>();
  if (pose.has_value()) {
    answer = SolvePose(configuration, *pose,
                       [this](const MakeFrame& make_frame) { return ShowEarly(make_frame); });
  }
  FinishAnswer(std::move(answer));
}

void DeformStreamReactor::FinishAnswer(absl::StatusOr<std::optional<AnswerFrame>> answer) {
  MutexLock lock(mutex_);
  if (!answer.ok()) End(answer.status());
  flow_->FinishSolve(answer.ok() ? *std::move(answer) : std::nullopt);
  Advance();
}

bool DeformStreamReactor::ShowEarly(const MakeFrame& make_frame) {
  FrameFlow::EarlyAnswer judgement = FrameFlow::EarlyAnswer::kStop;
  {
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) {
      judgement = flow_->JudgeEarly();
    }
  }
  if (judgement == FrameFlow::EarlyAnswer::kShow) {
    AnswerFrame frame = make_frame();  // without the lock: it encodes all vertices
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) {
      flow_->OfferEarly(std::move(frame));
      Advance();
    }
  }
  return judgement != FrameFlow::EarlyAnswer::kStop;
}

bool DeformStreamReactor::Ended() {
  MutexLock lock(mutex_);
  return outcome_.has_value();
}

}  // namespace tissueform
