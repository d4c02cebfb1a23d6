// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/watch_stream.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "grpcpp/impl/codegen/proto_utils.h"

#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"

namespace tissueform {
namespace {

constexpr absl::string_view kPrefix = "watches/";
constexpr auto kBaseEncoding = v1::POSITION_ENCODING_FLOAT32;

std::shared_ptr<const v1::WatchForm> SkinForm(const StoredMesh& mesh) {
  auto form = std::make_shared<v1::WatchForm>();
  form->set_vertex_count(static_cast<int64_t>(mesh.skin.size()));
  form->mutable_vertices()->Add(mesh.skin.begin(), mesh.skin.end());
  form->set_encoding(kBaseEncoding);
  return form;
}

v1::DeformFrame SkinFrame(const StoredMesh& mesh, const Positions& positions) {
  v1::DeformFrame frame;
  const VertexChoice skin{.all = false, .vertices = mesh.skin};
  *frame.mutable_positions() =
      EncodePositions(positions, skin, kBaseEncoding, mesh.mesh.positions()).bytes;
  return frame;
}

}  // namespace

std::string WatchName(const std::string& id) { return absl::StrCat(kPrefix, id); }

absl::StatusOr<std::string> ParseWatchName(const std::string& name) {
  absl::string_view id = name;
  if (absl::ConsumePrefix(&id, kPrefix) && !id.empty()) return std::string(id);
  return absl::InvalidArgumentError(
      "invalid watch name; send the one in `started`, \"watches/{id}\"");
}

WatchStreamReactor::WatchStreamReactor(CallScope scope, const grpc::ByteBuffer& request,
                                       const ServiceLimits& limits, Access* access,
                                       SessionRegistry* registry, SessionWatches* watches,
                                       DeadlineTimer* timer)
    : scope_(std::move(scope)),
      limits_(limits),
      access_(access),
      registry_(registry),
      watches_(watches),
      timer_(timer),
      id_(RandomId()),
      principal_(scope_.principal().name),
      authorization_(
          timer, &registry->pool(), kReauthorizePeriod, [this] { return AuthorizationQuestion(); },
          [this](const absl::Status& status) { EndUnauthorized(status); }) {
  const absl::Status admission =
      scope_.admission().ok() ? ReadRequest(request) : scope_.admission();
  MutexLock lock(mutex_);
  if (admission.ok()) {
    opening_ = true;
    if (scope_.may_end_early()) authorization_.Start();
    // Opening goes on when that is done: then the library has bound the reactor.
    StartSendInitialMetadata();
  } else {
    End(admission);
    Advance();
  }
}

absl::Status WatchStreamReactor::ReadRequest(const grpc::ByteBuffer& bytes) {
  grpc::ByteBuffer copy = bytes;  // reading uses it up
  v1::WatchRequest request;
  if (!grpc::SerializationTraits<v1::WatchRequest>::Deserialize(&copy, &request).ok()) {
    return absl::InvalidArgumentError("the request is not a WatchRequest");
  }
  TF_ASSIGN_OR_RETURN(session_id_, ParseSessionName(request.session()));
  if (!request.has_max_unacked()) return absl::OkStatus();
  max_unacked_ = request.max_unacked();
  if (max_unacked_ >= 1 && max_unacked_ <= limits_.max_unacked) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("max_unacked is ", max_unacked_, "; it must be 1 to ", limits_.max_unacked));
}

void WatchStreamReactor::OnSendInitialMetadataDone(bool ok) {
  if (!ok) {
    FinishOpening(absl::CancelledError("the client is gone"));
    return;
  }
  registry_->pool().Post(Lane::kLeases, [this, caller = scope_.principal()] {
    const absl::StatusOr<Access::Found> found =
        access_->CheckSessionAccess(caller, session_id_, Permission::kRead);
    if (!found.ok()) {
      FinishOpening(found.status());
      return;
    }
    if (*found == Access::Found::kYes) {
      MutexLock lock(mutex_);
      scope_.SetResource(SessionName(session_id_));
    }
    registry_->loader().Open(session_id_, cancelled_,
                             [this](absl::StatusOr<std::shared_ptr<Session>> session) {
                               TakeSession(std::move(session));
                             });
  });
}

void WatchStreamReactor::TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) {
  if (session.ok()) {
    Join(*session);
  } else {
    FinishOpening(session.status());
  }
}

void WatchStreamReactor::Join(const std::shared_ptr<Session>& session) {
  absl::StatusOr<SessionWatches::Joined> joined = watches_->Add(id_, session_id_, this, principal_);
  {
    MutexLock lock(mutex_);
    hold_ = session->hold();
  }
  if (!joined.ok() || joined->has_frame) {
    FinishOpening(joined.status());
    return;
  }
  channel_ = std::move(joined->channel);
  registry_->sync().Look(session_id_, [this, session](absl::StatusOr<SessionView> view) {
    if (!view.ok()) {
      FinishOpening(view.status());
      return;
    }
    session->strand().Post(
        session->LaneOf(session->model()),
        [this, session, poses = std::move(view->record.last_poses)] { MakeBase(session, poses); });
  });
}

void WatchStreamReactor::MakeBase(const std::shared_ptr<Session>& session,
                                  const std::vector<HandlePose>& committed) {
  const StoredMesh& mesh = session->mesh();
  if (committed.empty()) {
    channel_->PublishBase(v1::WATCH_ORIGIN_REST, SkinFrame(mesh, mesh.mesh.positions()),
                          SkinForm(mesh));
    FinishOpening(absl::OkStatus());
    return;
  }
  DeformControl control;
  control.on_progress = [this](const Deformation& /*so_far*/) { return !cancelled_->load(); };
  const absl::StatusOr<Deformation> answer = session->Solve(session->model(), committed, control);
  if (answer.ok()) {
    channel_->PublishBase(v1::WATCH_ORIGIN_COMMITTED, SkinFrame(mesh, answer->positions),
                          SkinForm(mesh));
  }
  FinishOpening(answer.status());
}

void WatchStreamReactor::FinishOpening(const absl::Status& outcome) {
  MutexLock lock(mutex_);
  opening_ = false;
  if (!outcome.ok()) End(outcome);
  Advance();
}

void WatchStreamReactor::OnWriteDone(bool ok) {
  MutexLock lock(mutex_);
  writing_.reset();
  if (!ok) End(absl::CancelledError("the client is gone"));
  Advance();
}

void WatchStreamReactor::OnCancel() {
  *cancelled_ = true;
  registry_->loader().CancelWait(cancelled_);
  MutexLock lock(mutex_);
  End(absl::CancelledError("the client ended the watch"));
  Advance();
}

void WatchStreamReactor::OnDone() {
  watches_->Remove(id_);
  authorization_.Stop();
  {
    MutexLock lock(mutex_);  // the thread that called Finish may still hold it
  }
  delete this;
}

StreamAuthorization::Question WatchStreamReactor::AuthorizationQuestion() {
  MutexLock lock(mutex_);
  if (finished_) return {};
  return [still_good = scope_.AuthorizationQuestion(), access = access_,
          caller = scope_.principal(), session = session_id_]() -> absl::Status {
    TF_RETURN_IF_ERROR(still_good());
    return access->RecheckSessionAccess(caller, session, Permission::kRead);
  };
}

void WatchStreamReactor::EndUnauthorized(const absl::Status& status) {
  {
    MutexLock lock(mutex_);
    End(status);
  }
  // As in OnCancel, with the outcome that is there already.
  *cancelled_ = true;
  registry_->loader().CancelWait(cancelled_);
  MutexLock lock(mutex_);
  Advance();
}

void WatchStreamReactor::Show(const std::shared_ptr<const WatchedFrame>& frame) {
  MutexLock lock(mutex_);
  newest_ = frame;
  Advance();
}

void WatchStreamReactor::Notify(const v1::DeformNotice& notice) {
  MutexLock lock(mutex_);
  notices_.push_back(notice);
  Advance();
}

void WatchStreamReactor::EndWatch(const absl::Status& outcome) {
  MutexLock lock(mutex_);
  if (!ending_.has_value()) ending_ = outcome;
  Advance();
}

absl::Status WatchStreamReactor::Acknowledge(uint64_t number, const Authenticated& by) {
  MutexLock lock(mutex_);
  if (number > last_sent_) {
    return absl::InvalidArgumentError(absl::StrCat("ack of frame ", number,
                                                   ", but the last frame sent is ", last_sent_,
                                                   "; acknowledge frames that arrived"));
  }
  scope_.RenewFrom(by);
  while (!unacked_.empty() && unacked_.front() <= number) unacked_.pop_front();
  Advance();
  return absl::OkStatus();
}

void WatchStreamReactor::End(const absl::Status& outcome) {
  if (!outcome_.has_value()) outcome_ = outcome;
}

void WatchStreamReactor::Advance() {
  if (finished_) return;
  if (const absl::Status held = CheckHold(hold_); !held.ok()) End(held);
  if (!outcome_.has_value() && writing_ == nullptr) {
    writing_ = NextMessage();
    if (writing_ != nullptr) {
      StartWrite(writing_.get());
    } else if (ending_.has_value()) {
      End(*ending_);
    }
  }
  if (outcome_.has_value() && !opening_ && writing_ == nullptr) {
    finished_ = true;
    Finish(scope_.End(*outcome_));
  }
}

SharedBytes WatchStreamReactor::NextMessage() {
  if (sent_form_ == nullptr) {
    if (newest_ == nullptr) return nullptr;
    sent_form_ = newest_->form;
    return Started();
  }
  v1::WatchResponse message;
  if (!notices_.empty()) {
    *message.mutable_notice() = std::move(notices_.front());
    notices_.pop_front();
    return ToBytes(message);
  }
  if (newest_ == nullptr || unacked_.size() >= static_cast<size_t>(max_unacked_)) return nullptr;
  if (newest_->form != sent_form_) {
    sent_form_ = newest_->form;
    *message.mutable_form() = *sent_form_;
    return ToBytes(message);
  }
  const std::shared_ptr<const WatchedFrame> frame = std::exchange(newest_, nullptr);
  last_sent_ = frame->number;
  unacked_.push_back(frame->number);
  return frame->bytes;
}

SharedBytes WatchStreamReactor::Started() const {
  v1::WatchResponse message;
  v1::WatchStarted* started = message.mutable_started();
  started->set_watch(WatchName(id_));
  started->set_max_unacked(max_unacked_);
  *started->mutable_form() = *sent_form_;
  return ToBytes(message);
}

}  // namespace tissueform
