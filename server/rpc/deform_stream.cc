// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_stream.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// After so long without a newer pose an estimate is worked out. Longer than poses of a drag are
// apart; shorter would take a processor from other drags for answers that nobody waits for.
constexpr std::chrono::milliseconds kRest{150};

}  // namespace

DeformStreamReactor::DeformStreamReactor(CallScope scope, const ServiceLimits& limits,
                                         const Access& access, SessionRegistry* registry,
                                         DeformStreams* streams, SessionWatches* watches,
                                         DeadlineTimer* timer)
    : scope_(std::move(scope)),
      principal_(scope_.principal().name),
      limits_(limits),
      access_(access),
      registry_(registry),
      streams_(streams),
      watches_(watches),
      timer_(timer) {
  absl::Status admission = scope_.admission();
  if (admission.ok()) {
    admission = streams_->Add(this);
    registered_ = admission.ok();
  }
  {
    MutexLock lock(commit_word_->mutex);
    commit_word_->stream = this;
  }
  MutexLock lock(mutex_);
  if (admission.ok()) {
    deadline_ = timer_->Start(std::chrono::steady_clock::now() + limits_.configuration_deadline,
                              [this] { EndUnlessConfigured(); });
    WaitToReauthorize();
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
      End(absl::InvalidArgumentError("the stream ended before its configuration; send it first"));
    }
  } else if (!outcome_.has_value()) {
    const bool configures = !flow_.has_value();
    if (const absl::Status status = Take(); !status.ok()) {
      End(status);
    } else if (!configures) {
      StartRead(&request_);  // after the configuration only when there is a session, see Configure
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
  *cancelled_ = true;
  registry_->CancelWait(cancelled_);
  MutexLock lock(mutex_);
  End(absl::CancelledError("the client canceled the stream"));
  Advance();
}

void DeformStreamReactor::WaitToReauthorize() {
  if (!scope_.may_end_early()) return;
  standing_ = timer_->Start(std::chrono::steady_clock::now() + kReauthorizePeriod,
                            [this] { RecheckAuthorization(); });
}

absl::Status DeformStreamReactor::IsStillAllowed() const {
  TF_RETURN_IF_ERROR(scope_.IsStillAuthorized());
  if (!flow_.has_value()) return absl::OkStatus();  // checked when it names its session
  return access_.RecheckSessionAccess(scope_.principal(), stream_request_.session_id,
                                      Permission::kWrite);
}

void DeformStreamReactor::RecheckAuthorization() {
  {
    MutexLock lock(mutex_);
    if (finished_) return;
    const absl::Status good = IsStillAllowed();
    if (good.ok()) {
      WaitToReauthorize();
      return;
    }
    End(good);
  }
  // As in OnCancel, with the outcome that is there already.
  *cancelled_ = true;
  registry_->CancelWait(cancelled_);
  MutexLock lock(mutex_);
  Advance();
}

void DeformStreamReactor::EndUnlessConfigured() {
  MutexLock lock(mutex_);
  if (flow_.has_value()) return;
  // A silent stream holds one of the places that others wait for.
  End(WithReason(absl::DeadlineExceededError(absl::StrCat(
                     "no configuration came within ", limits_.configuration_deadline.count(),
                     " ms after the stream opened; send it as the first message")),
                 ErrorReason::kNoConfigurationInTime));
  Advance();
}

void DeformStreamReactor::OnDone() {
  {
    MutexLock lock(commit_word_->mutex);
    commit_word_->stream = nullptr;
  }
  if (registered_) {
    streams_->Remove(this);
    timer_->Cancel(deadline_);
  }
  DeadlineTimer::Id rest;
  DeadlineTimer::Id standing;
  {
    MutexLock lock(mutex_);  // whoever called Finish may still hold it
    rest = rest_;
    standing = standing_;
  }
  timer_->Cancel(rest);
  timer_->Cancel(standing);
  DeadlineTimer::Id word;
  {
    MutexLock lock(followers_mutex_);  // the publisher is gone: no other word will come
    word = followers_word_;
  }
  timer_->Cancel(word);
  delete this;
}

// The channel is told of its watches under locks that come after this stream's own.
void DeformStreamReactor::FollowersChanged(int count) {
  MutexLock lock(followers_mutex_);
  followers_ = count;
  if (std::exchange(followers_due_, true)) return;
  followers_word_ = timer_->Start(std::chrono::steady_clock::now(), [this] { TellFollowers(); });
}

// Until nothing new is to be told: then one word at a time is under way, the one that OnDone waits
// for.
void DeformStreamReactor::TellFollowers() {
  for (bool is_due = true; is_due;) {
    int count = 0;
    {
      MutexLock lock(followers_mutex_);
      count = followers_;
    }
    Tell(count);
    MutexLock lock(followers_mutex_);
    is_due = followers_ != count;
    followers_due_ = is_due;
  }
}

void DeformStreamReactor::Tell(int followers) {
  MutexLock lock(mutex_);
  if (std::exchange(told_followers_, followers) == followers) return;
  notices_.emplace_back().mutable_followers()->set_count(followers);
  Advance();
}

void DeformStreamReactor::NotifyDraining(std::chrono::system_clock::time_point end) {
  MutexLock lock(mutex_);
  notices_.push_back(DrainingAt(end));
  Advance();
}

void DeformStreamReactor::EndIfMoved(const std::string& session_id) {
  {
    MutexLock lock(mutex_);
    if (configuration_ == nullptr || stream_request_.session_id != session_id) return;
    Advance();
    if (!moved_) return;
  }
  // It may wait for the session to be made again.
  *cancelled_ = true;
  registry_->CancelWait(cancelled_);
}

void DeformStreamReactor::EndUnlessHeld() {
  if (outcome_.has_value() || configuration_ == nullptr) return;
  if (const absl::Status held = configuration_->session->CheckHeld(); !held.ok()) End(held);
}

absl::Status DeformStreamReactor::Take() {
  if (!flow_.has_value()) {
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
    case v1::DeformRequest::kToken:
      return scope_.Renew(request_.token());
    case v1::DeformRequest::kConfiguration:
      return absl::InvalidArgumentError("a second configuration; open a new stream for it");
    case v1::DeformRequest::MESSAGE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("an empty message; send a pose or an ack");
}

absl::Status DeformStreamReactor::TakeConfiguration() {
  if (!request_.has_configuration()) {
    return absl::InvalidArgumentError("the first message must be the configuration");
  }
  TF_RETURN_IF_ERROR(
      AllowedSession(access_, &scope_, request_.configuration().session(), Permission::kWrite)
          .status());
  TF_ASSIGN_OR_RETURN(stream_request_, ReadStreamRequest(request_.configuration(), limits_));
  flow_.emplace(stream_request_.max_unacked, &streams_->measures());
  StartOpening();
  return absl::OkStatus();
}

void DeformStreamReactor::StartOpening() {
  flow_->StartPreparation();
  registry_->pool().Post(Lane::kFrames, [this, id = stream_request_.session_id] {
    registry_->Open(id, cancelled_, [this](absl::StatusOr<std::shared_ptr<Session>> session) {
      TakeSession(std::move(session));
    });
  });
}

void DeformStreamReactor::TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) {
  MutexLock lock(mutex_);
  const absl::Status status =
      session.ok() && !outcome_.has_value() ? Configure(*std::move(session)) : session.status();
  if (!status.ok()) End(status);
  if (outcome_.has_value()) {
    flow_->FinishPreparation();
  } else if (configuration_->NeedsPreparation()) {
    configuration_->session->making_strand().Post(
        Lane::kBatch, [this, configuration = configuration_] { Prepare(*configuration); });
  } else {
    Begin(BeginWithoutPreparation(*configuration_));
  }
  Advance();
}

absl::Status DeformStreamReactor::Configure(std::shared_ptr<Session> session) {
  if (configuration_ != nullptr) {
    if (configuration_->session->updated()) returning_ = Returning::kUpdated;
    TF_ASSIGN_OR_RETURN(configuration_, ConfigurationFor(stream_request_, *configuration_->session,
                                                         std::move(session)));
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(configuration_, ReadConfiguration(stream_request_, std::move(session)));
  StartRead(&request_);
  return absl::OkStatus();
}

void DeformStreamReactor::Begin(StreamBegin begin) {
  flow_->FinishPreparation();
  claim_ = std::move(begin.claim);
  if (!started_.has_value() && !has_started_) {
    publisher_.emplace(static_cast<Dragger*>(this), watches_->ChannelOf(stream_request_.session_id),
                       FormOf(*configuration_, begin.started.started()));
    started_ = std::move(begin.started);
  }
  const Returning returning = std::exchange(returning_, Returning::kNo);
  if (returning == Returning::kRestored) notices_.emplace_back().mutable_restored();
  if (returning == Returning::kUpdated) notices_.emplace_back().mutable_updated();
}

absl::Status DeformStreamReactor::TakePose(const v1::PoseUpdate& update) {
  TF_RETURN_IF_ERROR(flow_->CheckSequence(update.sequence()));
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses,
                      ToPoses(update.poses(), configuration_->session->constraints()));
  if (update.commit()) to_commit_ = {.sequence = update.sequence(), .poses = poses};
  return flow_->Put(update.sequence(), std::move(poses));
}

void DeformStreamReactor::StartCommit() {
  committing_ = true;
  registry_->pool().Post(
      Lane::kFrames, [registry = registry_, word = commit_word_, session = configuration_->session,
                      pose = *std::exchange(to_commit_, std::nullopt)]() mutable {
        registry->CommitPoses(session, std::move(pose.poses),
                              [word, sequence = pose.sequence](const absl::Status& outcome) {
                                word->Tell(sequence, outcome);
                              });
      });
}

void DeformStreamReactor::CommitWord::Tell(uint64_t sequence, const absl::Status& outcome) {
  MutexLock lock(mutex);
  if (stream != nullptr) stream->FinishCommit(sequence, outcome);
}

void DeformStreamReactor::FinishCommit(uint64_t sequence, const absl::Status& outcome) {
  MutexLock lock(mutex_);
  committing_ = false;
  if (HasReason(outcome, ErrorReason::kSessionMoved)) {
    End(outcome);
    Advance();
    return;
  }
  v1::CommittedNotice* notice = notices_.emplace_back().mutable_committed();
  notice->set_sequence(sequence);
  if (!outcome.ok()) notice->set_failure(MessageForClients(outcome));
  Advance();
}

void DeformStreamReactor::End(const absl::Status& outcome) {
  if (!outcome_.has_value()) {
    outcome_ = outcome;
    moved_ = HasReason(outcome, ErrorReason::kSessionMoved);
  }
}

void DeformStreamReactor::Advance() {
  if (finished_) {
    return;
  }
  EndUnlessHeld();
  if (!outcome_.has_value() && flow_.has_value()) {
    WriteNext();
    if (to_commit_.has_value() && !committing_) StartCommit();
    const bool at_rest = std::chrono::steady_clock::now() >= estimated_at_ + kRest;
    if (flow_->StartSolve()) {
      StartAnswer();
    } else if (flow_->StartRefinement(at_rest)) {
      configuration_->session->strand().Post(
          Lane::kIterations, [this, configuration = configuration_] { Refine(*configuration); });
    } else if (flow_->Done() && !write_in_flight_ && !committing_ && notices_.empty()) {
      End(absl::OkStatus());
    }
  }
  const bool waits_for_commit = committing_ && !moved_;
  const bool busy = write_in_flight_ || waits_for_commit || (flow_.has_value() && flow_->busy());
  if (outcome_.has_value() && !busy) {
    finished_ = true;
    // Before the client hears of the end: who begins to watch then does not find a drag.
    publisher_.reset();
    Finish(scope_.End(*outcome_));
  }
}

void DeformStreamReactor::WriteNext() {
  if (write_in_flight_) {
    return;
  }
  if (std::optional<v1::DeformResponse> next = NextMessage(); next.has_value()) {
    writing_ = std::make_shared<const v1::DeformResponse>(*std::move(next));
    write_in_flight_ = true;
    StartWrite(writing_.get());
    if (writing_->has_frame()) publisher_->Publish(writing_);
  }
}

std::optional<v1::DeformResponse> DeformStreamReactor::NextMessage() {
  if (started_.has_value()) {
    has_started_ = true;
    return std::exchange(started_, std::nullopt);
  }
  // A notice that comes earlier waits: `started` is the first message.
  if (has_started_ && !notices_.empty()) {
    v1::DeformResponse response;
    *response.mutable_notice() = std::move(notices_.front());
    notices_.pop_front();
    return response;
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
  if (begin.ok()) {
    Begin(*std::move(begin));
  } else if (configuration.session->evicted() && !outcome_.has_value()) {
    StartOpening();
  } else {
    flow_->FinishPreparation();
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
                                       const std::shared_ptr<PreparedAnswersRef>& claim) {
  std::optional<WaitingPose> pose = TakePose();
  absl::StatusOr<std::optional<AnswerFrame>> answer = std::optional<AnswerFrame>();
  if (pose.has_value()) answer = AnswerFromPrepared(*configuration, *claim, *pose);
  if (!pose.has_value() || !answer.ok() || answer->has_value()) {
    FinishAnswer(*configuration->session, std::move(pose), std::move(answer));
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
  FinishAnswer(*configuration.session, std::move(pose), std::move(answer));
}

void DeformStreamReactor::Refine(const StreamConfiguration& configuration) {
  std::optional<WaitingPose> pose;
  {
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) pose = flow_->TakeRefinement();
  }
  absl::StatusOr<std::optional<AnswerFrame>> answer = std::optional<AnswerFrame>();
  if (pose.has_value()) {
    // Early answers begin with the linear one, which is worse than the estimate that is there.
    answer = SolvePose(configuration, *pose, [this](const MakeFrame& /*make_frame*/) {
      MutexLock lock(mutex_);
      return !outcome_.has_value() && flow_->JudgeEarly() != FrameScheduler::EarlyAnswer::kStop;
    });
  }
  FinishAnswer(*configuration.session, std::move(pose), std::move(answer));
}

void DeformStreamReactor::WaitForRest() {
  estimated_at_ = std::chrono::steady_clock::now();
  if (rest_ != DeadlineTimer::Id()) return;  // looks when it ends how long the hand has rested
  rest_ = timer_->Start(estimated_at_ + kRest, [this] { EndOfWait(); });
}

void DeformStreamReactor::EndOfWait() {
  MutexLock lock(mutex_);
  rest_ = DeadlineTimer::Id();
  if (finished_ || !flow_->has_estimate()) return;
  if (std::chrono::steady_clock::now() < estimated_at_ + kRest) {
    rest_ = timer_->Start(estimated_at_ + kRest, [this] { EndOfWait(); });
  } else {
    Advance();
  }
}

void DeformStreamReactor::FinishAnswer(const Session& session, std::optional<WaitingPose> pose,
                                       absl::StatusOr<std::optional<AnswerFrame>> answer) {
  MutexLock lock(mutex_);
  const bool left_memory = !answer.ok() && session.evicted();
  if (!answer.ok() && !left_memory) End(answer.status());
  if (answer.ok() && answer->has_value() && (*answer)->refining) {
    flow_->FinishEstimate(**std::move(answer), *std::move(pose));
    WaitForRest();
    Advance();
    return;
  }
  flow_->FinishSolve(answer.ok() ? *std::move(answer) : std::nullopt);
  if (left_memory && !outcome_.has_value()) {
    if (pose.has_value()) flow_->PutBack(*std::move(pose));
    if (!session.updated()) {
      returning_ = Returning::kRestored;
      notices_.emplace_back().mutable_evicted();
    }
    StartOpening();
  }
  Advance();
}

bool DeformStreamReactor::ShowEarly(const MakeFrame& make_frame) {
  FrameScheduler::EarlyAnswer judgement = FrameScheduler::EarlyAnswer::kStop;
  {
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) {
      judgement = flow_->JudgeEarly();
    }
  }
  if (judgement == FrameScheduler::EarlyAnswer::kShow) {
    AnswerFrame frame = make_frame();  // without the lock: it encodes all vertices
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) {
      flow_->OfferEarly(std::move(frame));
      Advance();
    }
  }
  return judgement != FrameScheduler::EarlyAnswer::kStop;
}

bool DeformStreamReactor::Ended() {
  MutexLock lock(mutex_);
  return outcome_.has_value();
}

}  // namespace tissueform
