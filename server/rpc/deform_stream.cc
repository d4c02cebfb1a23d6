// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_stream.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"

namespace tissueform {

DeformStreamReactor::DeformStreamReactor(CallScope scope, const ServiceLimits& limits,
                                         Access* access, SessionRegistry* registry,
                                         DeformStreams* streams, SessionWatches* watches,
                                         DeadlineTimer* timer)
    : scope_(std::move(scope)),
      principal_(scope_.principal().name),
      limits_(limits),
      access_(access),
      registry_(registry),
      streams_(streams),
      watches_(watches),
      timer_(timer),
      authorization_(
          timer, &registry->pool(), kReauthorizePeriod, [this] { return AuthorizationQuestion(); },
          [this](const absl::Status& status) { EndUnauthorized(status); }),
      followers_(timer, [this](int count) { NotifyFollowers(count); }),
      commits_(
          [registry](std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
                     StreamCommits::Outcome done) {
            registry->pool().Post(Lane::kFrames, [registry, session = std::move(session),
                                                  poses = std::move(poses),
                                                  done = std::move(done)]() mutable {
              registry->sync().CommitPoses(std::move(session), std::move(poses), std::move(done));
            });
          },
          [this](uint64_t sequence, const absl::Status& outcome) {
            FinishCommit(sequence, outcome);
          }),
      rest_(timer, [this] { EndRest(); }) {
  absl::Status admission = scope_.admission();
  if (admission.ok()) {
    admission = streams_->Add(this);
    registered_ = admission.ok();
  }
  MutexLock lock(mutex_);
  if (admission.ok()) {
    deadline_ = timer_->Start(std::chrono::steady_clock::now() + limits_.configuration_deadline,
                              [this] { EndUnlessConfigured(); });
    if (scope_.may_end_early()) authorization_.Start();
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
  StopWaiting();
  MutexLock lock(mutex_);
  End(absl::CancelledError("the client canceled the stream"));
  Advance();
}

void DeformStreamReactor::StopWaiting() {
  *cancelled_ = true;
  registry_->loader().CancelWait(cancelled_);
}

StreamAuthorization::Question DeformStreamReactor::AuthorizationQuestion() {
  MutexLock lock(mutex_);
  if (finished_) return {};
  // Until it names its session nothing else is checked.
  const std::string session = flow_.has_value() ? opening_.request().session_id : "";
  return [still_good = scope_.AuthorizationQuestion(), access = access_,
          caller = scope_.principal(), session]() -> absl::Status {
    TF_RETURN_IF_ERROR(still_good());
    if (session.empty()) return absl::OkStatus();
    return access->RecheckSessionAccess(caller, session, Permission::kWrite);
  };
}

void DeformStreamReactor::EndUnauthorized(const absl::Status& status) {
  {
    MutexLock lock(mutex_);
    End(status);
  }
  StopWaiting();  // with the outcome that is there already
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
  commits_.Stop();
  if (registered_) {
    streams_->Remove(this);
    timer_->Cancel(deadline_);
  }
  authorization_.Stop();
  DeadlineTimer::Id rest;
  {
    MutexLock lock(mutex_);  // the thread that called Finish may still hold it
    rest = rest_.wait();
  }
  timer_->Cancel(rest);
  followers_.Stop();  // the publisher is gone
  delete this;
}

void DeformStreamReactor::NotifyFollowers(int count) {
  MutexLock lock(mutex_);
  notices_.emplace_back().mutable_followers()->set_count(count);
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
    if (opening_.configuration() == nullptr || opening_.request().session_id != session_id) return;
    Advance();
    if (!moved_) return;
  }
  StopWaiting();
}

void DeformStreamReactor::EndUnlessHeld() {
  if (outcome_.has_value() || opening_.configuration() == nullptr) return;
  const Session& session = *opening_.configuration()->session;
  if (const absl::Status held = session.CheckHeld(); !held.ok()) End(held);
}

absl::Status DeformStreamReactor::Take() {
  if (!flow_.has_value()) {
    return TakeConfiguration();
  }
  switch (request_.message_case()) {
    case v1::DeformRequest::kPose:
      return PutPose(request_.pose());
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
  TF_RETURN_IF_ERROR(opening_.TakeRequest(request_.configuration(), limits_));
  flow_.emplace(opening_.request().max_unacked, &streams_->measures());
  flow_->StartPreparation();
  registry_->pool().Post(Lane::kLeases,
                         [this, caller = scope_.principal(), id = opening_.request().session_id] {
                           const absl::StatusOr<Access::Found> found =
                               access_->CheckSessionAccess(caller, id, Permission::kWrite);
                           if (!found.ok()) {
                             TakeSession(found.status());
                             return;
                           }
                           if (*found == Access::Found::kYes) {
                             MutexLock lock(mutex_);
                             scope_.SetResource(SessionName(id));
                           }
                           OpenSession(id);
                         });
  return absl::OkStatus();
}

void DeformStreamReactor::OpenSession(const std::string& id) {
  registry_->loader().Open(id, cancelled_,
                           [this](absl::StatusOr<std::shared_ptr<Session>> session) {
                             TakeSession(std::move(session));
                           });
}

void DeformStreamReactor::StartOpening() {
  flow_->StartPreparation();
  registry_->pool().Post(Lane::kFrames,
                         [this, id = opening_.request().session_id] { OpenSession(id); });
}

void DeformStreamReactor::TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) {
  MutexLock lock(mutex_);
  const absl::Status status =
      session.ok() && !outcome_.has_value() ? Configure(*std::move(session)) : session.status();
  if (!status.ok()) End(status);
  const StreamOpening::Configuration& configuration = opening_.configuration();
  if (outcome_.has_value()) {
    flow_->FinishPreparation();
  } else if (configuration->NeedsPreparation()) {
    configuration->session->making_strand().Post(
        Lane::kBatch, [this, configuration] { Prepare(*configuration); });
  } else {
    Begin(BeginWithoutPreparation(*configuration));
  }
  Advance();
}

absl::Status DeformStreamReactor::Configure(std::shared_ptr<Session> session) {
  const bool is_first = opening_.configuration() == nullptr;
  TF_RETURN_IF_ERROR(opening_.TakeSession(std::move(session)));
  if (is_first) StartRead(&request_);
  return absl::OkStatus();
}

void DeformStreamReactor::Begin(StreamBegin begin) {
  flow_->FinishPreparation();
  claim_ = std::move(begin.claim);
  if (!started_.has_value() && !has_started_) {
    publisher_.emplace(&followers_, watches_->ChannelOf(opening_.request().session_id),
                       FormOf(*opening_.configuration(), begin.started.started()));
    started_ = std::move(begin.started);
  }
  Notify(opening_.Resume());
}

void DeformStreamReactor::Notify(std::optional<v1::DeformNotice> notice) {
  if (notice.has_value()) notices_.push_back(*std::move(notice));
}

absl::Status DeformStreamReactor::PutPose(const v1::PoseUpdate& update) {
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses,
                      ToPoses(update.poses(), opening_.configuration()->session->constraints()));
  if (update.commit()) commits_.Put(update.sequence(), poses);
  return flow_->Put(update.sequence(), std::move(poses));
}

void DeformStreamReactor::FinishCommit(uint64_t sequence, const absl::Status& outcome) {
  MutexLock lock(mutex_);
  v1::DeformNotice notice = commits_.Finish(sequence, outcome);
  if (HasReason(outcome, ErrorReason::kSessionMoved)) {
    End(outcome);
  } else {
    Notify(std::move(notice));
  }
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
  if (!outcome_.has_value() && flow_.has_value()) StartNext();
  const bool waits_for_commit = commits_.under_way() && !moved_;
  const bool busy = write_in_flight_ || waits_for_commit || (flow_.has_value() && flow_->busy());
  if (outcome_.has_value() && !busy) {
    finished_ = true;
    // Before the client hears of the end: who begins to watch then does not find a drag.
    publisher_.reset();
    Finish(scope_.End(*outcome_));
  }
}

void DeformStreamReactor::StartNext() {
  WriteNext();
  if (opening_.configuration() != nullptr) commits_.StartNext(opening_.configuration()->session);
  if (flow_->StartSolve()) {
    PostAnswer(this, opening_.configuration(), claim_);
  } else if (flow_->StartRefinement(rest_.IsOver(std::chrono::steady_clock::now()))) {
    PostRefinement(this, opening_.configuration());
  } else if (flow_->Done() && !write_in_flight_ && !commits_.under_way() && notices_.empty()) {
    End(absl::OkStatus());
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

std::optional<WaitingPose> DeformStreamReactor::TakeNewest() {
  MutexLock lock(mutex_);
  return outcome_.has_value() ? std::nullopt : flow_->TakePose();
}

std::optional<WaitingPose> DeformStreamReactor::TakeEstimated() {
  MutexLock lock(mutex_);
  return outcome_.has_value() ? std::nullopt : flow_->TakeRefinement();
}

FrameScheduler::EarlyAnswer DeformStreamReactor::JudgeEarly() {
  MutexLock lock(mutex_);
  return outcome_.has_value() ? FrameScheduler::EarlyAnswer::kStop : flow_->JudgeEarly();
}

void DeformStreamReactor::OfferEarly(AnswerFrame frame) {
  MutexLock lock(mutex_);
  if (outcome_.has_value()) return;
  flow_->OfferEarly(std::move(frame));
  Advance();
}

void DeformStreamReactor::FinishAnswer(const Session& session, std::optional<WaitingPose> pose,
                                       absl::StatusOr<std::optional<AnswerFrame>> answer) {
  MutexLock lock(mutex_);
  const bool left_memory = !answer.ok() && session.evicted();
  if (!answer.ok() && !left_memory) End(answer.status());
  if (answer.ok() && answer->has_value() && (*answer)->refining) {
    flow_->FinishEstimate(**std::move(answer), *std::move(pose));
    rest_.Begin(std::chrono::steady_clock::now());
    Advance();
    return;
  }
  flow_->FinishSolve(answer.ok() ? *std::move(answer) : std::nullopt);
  if (left_memory && !outcome_.has_value()) {
    if (pose.has_value()) flow_->PutBack(*std::move(pose));
    Notify(opening_.Leave());
    StartOpening();
  }
  Advance();
}

void DeformStreamReactor::EndRest() {
  MutexLock lock(mutex_);
  const bool is_needed = !finished_ && flow_->has_estimate();
  if (rest_.EndWait(std::chrono::steady_clock::now(), is_needed)) Advance();
}

bool DeformStreamReactor::Ended() {
  MutexLock lock(mutex_);
  return outcome_.has_value();
}

}  // namespace tissueform
