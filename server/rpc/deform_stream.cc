// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_stream.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

v1::DeformResponse MakeFrame(uint64_t sequence, int64_t coalesced_count,
                             const SolveSummary& summary, std::string positions) {
  v1::DeformResponse response;
  v1::DeformFrame* frame = response.mutable_frame();
  frame->set_sequence(sequence);
  frame->set_coalesced_count(coalesced_count);
  *frame->mutable_summary() = ToProto(summary);
  *frame->mutable_positions() = std::move(positions);
  return response;
}

absl::Status ReadPrepared(const v1::PreparedAnswers& settings, ResponseRequest* request) {
  if (settings.has_tolerance_mm()) request->tolerance_mm = settings.tolerance_mm();
  if (settings.has_max_rotation()) request->max_rotation_rad = settings.max_rotation();
  for (const double number : {request->tolerance_mm, request->max_rotation_rad}) {
    if (!std::isfinite(number) || number <= 0) {
      return absl::InvalidArgumentError(absl::StrCat(
          "prepared.tolerance_mm and max_rotation must be positive numbers, not ", number));
    }
  }
  return absl::OkStatus();
}

}  // namespace

DeformStreamReactor::DeformStreamReactor(const CallScope& scope, const ServiceLimits& limits,
                                         SessionRegistry* registry, DeformStreams* streams)
    : scope_(scope), limits_(limits), registry_(registry), streams_(streams) {
  absl::Status admission = scope_.admission();
  if (admission.ok()) {
    admission = streams_->Add(this);
    registered_ = admission.ok();
  }
  MutexLock lock(mutex_);
  if (admission.ok()) {
    StartRead(&request_);
  } else {
    End(admission);
    Advance();
  }
}

void DeformStreamReactor::OnReadDone(bool ok) {
  MutexLock lock(mutex_);
  if (!ok) {
    client_closed_ = true;
    if (session_ == nullptr) {
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

void DeformStreamReactor::OnDone() {
  if (registered_) {
    streams_->Remove(this);
  }
  {
    MutexLock lock(mutex_);  // whoever called Finish may still hold it
  }
  delete this;
}

void DeformStreamReactor::NotifyDraining() {
  MutexLock lock(mutex_);
  notice_.emplace().mutable_notice()->mutable_draining();
  Advance();
}

absl::Status DeformStreamReactor::Take() {
  if (session_ == nullptr) {
    if (!request_.has_configuration()) {
      return absl::InvalidArgumentError("the first message must be the configuration");
    }
    return TakeConfiguration(request_.configuration());
  }
  switch (request_.message_case()) {
    case v1::DeformRequest::kPose:
      return TakePose(request_.pose());
    case v1::DeformRequest::kAck:
      return TakeAck(request_.ack());
    case v1::DeformRequest::kConfiguration:
      return absl::InvalidArgumentError("a second configuration; open another stream for it");
    case v1::DeformRequest::MESSAGE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("a message without content; send a pose or an ack");
}

absl::Status DeformStreamReactor::TakeConfiguration(const v1::DeformConfiguration& configuration) {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(configuration.session()));
  TF_RETURN_IF_ERROR(CheckEncoding(configuration.encoding()));
  if (configuration.has_max_unacked()) {
    if (configuration.max_unacked() < 1 || configuration.max_unacked() > limits_.max_unacked) {
      return absl::InvalidArgumentError(absl::StrCat("max_unacked is ", configuration.max_unacked(),
                                                     "; it must be 1 to ", limits_.max_unacked));
    }
    max_unacked_ = configuration.max_unacked();
  }
  TF_ASSIGN_OR_RETURN(std::shared_ptr<Session> session, registry_->Find(id));
  TF_ASSIGN_OR_RETURN(choice_,
                      ToVertexChoice(configuration.vertices(), session->mesh().mesh.num_vertices(),
                                     session->mesh().skin));
  TF_RETURN_IF_ERROR(ReadAnswers(configuration, *session));
  session_ = std::move(session);
  if (response_request_.has_value() || model_ != session_->model()) {
    solving_ = true;
    session_->strand().Post([this] { PrepareAnswers(); });
  } else {
    SendStarted(nullptr);
  }
  return absl::OkStatus();
}

absl::Status DeformStreamReactor::ReadAnswers(const v1::DeformConfiguration& configuration,
                                              const Session& session) {
  TF_ASSIGN_OR_RETURN(model_, ToModel(configuration.model(), session.model()));
  if (!configuration.has_prepared()) return absl::OkStatus();
  ResponseRequest request{.model = model_, .vertices = choice_.vertices};
  TF_RETURN_IF_ERROR(ReadPrepared(configuration.prepared(), &request));
  if (choice_.all) {
    request.vertices.resize(session.mesh().mesh.num_vertices());
    std::iota(request.vertices.begin(), request.vertices.end(), 0);
  }
  response_request_ = std::move(request);
  return absl::OkStatus();
}

void DeformStreamReactor::SendStarted(const VertexResponse* response) {
  v1::DeformStarted* started = started_.emplace().mutable_started();
  started->set_max_unacked(static_cast<int32_t>(max_unacked_));
  started->set_vertex_count(choice_.all ? session_->mesh().mesh.num_vertices()
                                        : static_cast<int64_t>(choice_.vertices.size()));
  started->mutable_vertices()->Add(choice_.vertices.begin(), choice_.vertices.end());
  if (response != nullptr) {
    started->set_prepared_terms(response->num_terms());
    started->set_prepared_bytes(response->bytes_held());
  }
}

void DeformStreamReactor::PrepareAnswers() {
  std::shared_ptr<Session> session;
  DeformationModel model = DeformationModel::kGradientField;
  const ResponseRequest* request = nullptr;
  {
    MutexLock lock(mutex_);
    session = session_;
    model = model_;
    request = response_request_.has_value() ? &*response_request_ : nullptr;
  }
  const CancelledFunction cancelled = [this] { return Ended(); };
  absl::Status status = session->PrepareModel(model, cancelled);
  const VertexResponse* response = nullptr;
  if (status.ok() && request != nullptr) {
    const absl::StatusOr<VertexResponse*> prepared = session->PrepareResponse(*request, cancelled);
    status = prepared.status();
    response = prepared.ok() ? *prepared : nullptr;
  }
  MutexLock lock(mutex_);
  solving_ = false;
  if (status.ok()) {
    SendStarted(response);
  } else {
    End(status);
  }
  Advance();
}

absl::Status DeformStreamReactor::TakePose(const v1::PoseUpdate& update) {
  if (last_sequence_.has_value() && update.sequence() <= *last_sequence_) {
    return absl::InvalidArgumentError(absl::StrCat("sequence ", update.sequence(), " after ",
                                                   *last_sequence_,
                                                   "; sequences must rise from pose to pose"));
  }
  PendingPose pending;
  TF_ASSIGN_OR_RETURN(pending.poses, ToPoses(update.poses(), session_->constraints()));
  pending.sequence = update.sequence();
  pending.coalesced_count = mailbox_.has_value() ? mailbox_->coalesced_count + 1 : 0;
  last_sequence_ = update.sequence();
  mailbox_ = std::move(pending);
  return absl::OkStatus();
}

absl::Status DeformStreamReactor::TakeAck(const v1::FrameAck& ack) {
  const int32_t refinement =
      ack.has_refinement() ? ack.refinement() : std::max(0, CountFrames(ack.sequence()) - 1);
  const FrameNumber acknowledged(ack.sequence(), refinement);
  if (!last_frame_.has_value() || acknowledged > *last_frame_) {
    return absl::InvalidArgumentError(
        absl::StrCat("ack of frame ", ack.sequence(), ", refinement ", refinement,
                     ", which was not sent; acknowledge frames that arrived"));
  }
  while (!unacked_.empty() && unacked_.front() <= acknowledged) {
    unacked_.pop_front();
  }
  return absl::OkStatus();
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
  if (!outcome_.has_value()) {
    WriteNext();
    if (MaySolve()) {
      solving_ = true;
      session_->strand().Post([this] { SolveNewest(); });
    } else if (client_closed_ && !solving_ && !write_in_flight_ && !mailbox_.has_value()) {
      End(absl::OkStatus());
    }
  }
  if (MayFinish()) {
    finished_ = true;
    Finish(scope_.End(*outcome_));
  }
}

void DeformStreamReactor::WriteNext() {
  if (write_in_flight_) {
    return;
  }
  for (std::optional<v1::DeformResponse>* next : {&started_, &notice_, &frame_}) {
    // A notice that comes before the configuration waits: `started` is the first message.
    if (next->has_value() && session_ != nullptr) {
      writing_ = *std::move(*next);
      next->reset();
      write_in_flight_ = true;
      StartWrite(&writing_);
      return;
    }
  }
}

bool DeformStreamReactor::MaySolve() const {
  // While a finished frame waits for its write, a newer pose may still come for the next one.
  const bool has_credit = client_closed_ || unacked_.size() < max_unacked_;
  return mailbox_.has_value() && !solving_ && !frame_.has_value() && has_credit;
}

bool DeformStreamReactor::MayFinish() const {
  return outcome_.has_value() && !solving_ && !write_in_flight_;
}

void DeformStreamReactor::SolveNewest() {
  std::optional<PendingPose> pose;
  std::shared_ptr<Session> session;
  {
    MutexLock lock(mutex_);
    if (!outcome_.has_value()) {
      pose = std::exchange(mailbox_, std::nullopt);
    }
    session = session_;
  }
  bool given_up = false;
  absl::StatusOr<v1::DeformResponse> response = v1::DeformResponse();
  if (pose.has_value()) response = Answer(*pose, session.get(), &given_up);
  MutexLock lock(mutex_);
  solving_ = false;
  if (!response.ok()) {
    End(response.status());
  } else if (pose.has_value() && !(given_up && CountFrames(pose->sequence) > 0)) {
    // An answer that was given up is still better than none for its pose.
    Offer(*std::move(response));
  }
  Advance();
}

absl::StatusOr<v1::DeformResponse> DeformStreamReactor::Answer(const PendingPose& pose,
                                                               Session* session, bool* given_up) {
  const VertexChoice* choice = nullptr;
  const ResponseRequest* request = nullptr;
  DeformationModel model = DeformationModel::kGradientField;
  {
    MutexLock lock(mutex_);
    choice = &choice_;
    request = response_request_.has_value() ? &*response_request_ : nullptr;
    model = model_;
  }
  if (request != nullptr) {
    TF_ASSIGN_OR_RETURN(const std::optional<PreparedAnswer> answer,
                        session->Respond(*request, pose.poses));
    if (answer.has_value()) {
      return MakeFrame(pose.sequence, pose.coalesced_count, answer->summary,
                       EncodePositions(answer->positions));
    }
  }
  DeformControl control;
  control.warm_start = true;
  control.on_progress = [&](const Deformation& so_far) { return ShowEarly(pose, so_far, *choice); };
  TF_ASSIGN_OR_RETURN(const Deformation deformation, session->Deform(model, pose.poses, control));
  *given_up = deformation.summary.cancelled;
  return MakeFrame(pose.sequence, pose.coalesced_count, deformation.summary,
                   EncodePositions(deformation.positions, *choice));
}

bool DeformStreamReactor::Ended() {
  MutexLock lock(mutex_);
  return outcome_.has_value();
}

bool DeformStreamReactor::ShowEarly(const PendingPose& pose, const Deformation& so_far,
                                    const VertexChoice& choice) {
  {
    MutexLock lock(mutex_);
    if (outcome_.has_value() || mailbox_.has_value()) {
      return false;
    }
    // One credit is kept for the last answer.
    if (frame_.has_value() || unacked_.size() + 1 >= max_unacked_) {
      return true;
    }
  }
  v1::DeformResponse response = MakeFrame(pose.sequence, pose.coalesced_count, so_far.summary,
                                          EncodePositions(so_far.positions, choice));
  response.mutable_frame()->set_refining(true);
  MutexLock lock(mutex_);
  if (!outcome_.has_value()) {
    Offer(std::move(response));
    Advance();
  }
  return true;
}

void DeformStreamReactor::Offer(v1::DeformResponse frame) {
  const uint64_t sequence = frame.frame().sequence();
  if (frame_.has_value()) {
    // The same pose: nothing else is computed while a frame waits.
    frame.mutable_frame()->set_refinement(frame_->frame().refinement());
  } else {
    const FrameNumber number(sequence, CountFrames(sequence));
    frame.mutable_frame()->set_refinement(number.second);
    unacked_.push_back(number);
    last_frame_ = number;
  }
  if (frame.frame().refinement() > 0) {
    frame.mutable_frame()->set_coalesced_count(0);  // told by the first frame of the pose
  }
  frame_ = std::move(frame);
}

int32_t DeformStreamReactor::CountFrames(uint64_t sequence) const {
  return last_frame_.has_value() && last_frame_->first == sequence ? last_frame_->second + 1 : 0;
}

}  // namespace tissueform
