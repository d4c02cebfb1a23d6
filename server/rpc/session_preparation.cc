// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/session_preparation.h"

#include <string>
#include <utility>

#include "core/base/cancellation.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {

SessionPreparation::SessionPreparation(const ServiceLimits& limits, Access* access,
                                       MeshCatalog* catalog, SessionRegistry* registry,
                                       v1::PrepareSessionRequest request,
                                       SessionProgressCallback on_progress, OnAllowed on_allowed,
                                       Done done)
    : limits_(limits),
      access_(access),
      catalog_(catalog),
      registry_(registry),
      request_(std::move(request)),
      on_progress_(std::move(on_progress)),
      on_allowed_(std::move(on_allowed)),
      done_(std::move(done)) {}

absl::Status SessionPreparation::AuthorizeUse(const Principal& caller, const std::string& name,
                                              Permission need) {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(name));
  TF_ASSIGN_OR_RETURN(const Access::Found found, access_->CheckSessionAccess(caller, id, need));
  MutexLock lock(mutex_);  // so that `done` comes after it
  if (done_ && found == Access::Found::kYes) on_allowed_(name);
  return absl::OkStatus();
}

absl::Status SessionPreparation::Authorize(const Principal& caller) {
  switch (request_.what_case()) {
    case v1::PrepareSessionRequest::kCreate: {
      TF_ASSIGN_OR_RETURN(const std::string mesh, ParseMeshName(request_.create().mesh()));
      TF_RETURN_IF_ERROR(access_->CheckMeshAccess(caller, mesh, Permission::kRead));
      return Access::CheckProjectAccess(caller, request_.create().project());
    }
    case v1::PrepareSessionRequest::kUpdate:
      return AuthorizeUse(caller, request_.update().name(), Permission::kOwner);
    case v1::PrepareSessionRequest::kOpen:
      return AuthorizeUse(caller, request_.open(), Permission::kWrite);
    case v1::PrepareSessionRequest::WHAT_NOT_SET:
      break;
  }
  return absl::OkStatus();  // refused by Begin
}

void SessionPreparation::Start(const absl::Status& admission, const Principal& caller) {
  if (!admission.ok()) {
    Finish(admission);
    return;
  }
  // A creation reads a mesh here; the others only ask, and must not wait behind such reads.
  const Lane lane = request_.has_create() ? Lane::kStore : Lane::kLeases;
  registry_->pool().Post(lane, [self = shared_from_this(), caller] {
    if (*self->cancelled_) return;
    absl::Status begun = self->Authorize(caller);
    if (begun.ok()) begun = self->Begin(caller);
    if (!begun.ok()) self->Finish(begun);
  });
}

absl::Status SessionPreparation::Begin(const Principal& caller) {
  switch (request_.what_case()) {
    case v1::PrepareSessionRequest::kCreate:
      return BeginCreation(caller);
    case v1::PrepareSessionRequest::kUpdate:
      return BeginUpdate();
    case v1::PrepareSessionRequest::kOpen:
      return BeginOpening();
    case v1::PrepareSessionRequest::WHAT_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("the request is empty; send create, update or open");
}

absl::Status SessionPreparation::BeginCreation(const Principal& caller) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(request_.create().mesh()));
  if (auto mesh = catalog_->Find(sha256); mesh != nullptr) return Make(caller, mesh);
  ReportProgress({SessionStage::kReadingMesh});
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<const StoredMesh> mesh, catalog_->Load(sha256));
  return Make(caller, mesh);
}

absl::Status SessionPreparation::Make(const Principal& caller,
                                      const std::shared_ptr<const StoredMesh>& mesh) {
  // Nothing is begun for a client that has left while the mesh was read.
  if (*cancelled_) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(SessionRecord record,
                      ToSessionRecord(request_.create(), *mesh, caller, limits_));
  registry_->loader().Create(
      std::move(record), mesh, cancelled_,
      [self = shared_from_this()](const absl::StatusOr<std::shared_ptr<Session>>& session) {
        if (session.ok()) {
          self->TakeSession(*session, /*claimed=*/*session);
        } else {
          self->Finish(session.status());
        }
      },
      ProgressCallback());
  return absl::OkStatus();
}

absl::Status SessionPreparation::BeginUpdate() {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request_.update().name()));
  TF_RETURN_IF_ERROR(CheckNamesSomething(request_.update()));
  registry_->loader().Update(
      id, request_.update().etag(),
      [self = shared_from_this()](SessionRecord record, const StoredMesh& mesh) {
        return ToUpdatedRecord(self->request_.update(), std::move(record), mesh, self->limits_);
      },
      cancelled_,
      [self = shared_from_this()](const absl::StatusOr<SessionView>& view) {
        if (view.ok()) {
          self->TakeSession(view->session, /*claimed=*/nullptr);
        } else {
          self->Finish(view.status());
        }
      },
      ProgressCallback());
  return absl::OkStatus();
}

absl::Status SessionPreparation::BeginOpening() {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request_.open()));
  registry_->loader().Open(
      id, cancelled_,
      [self = shared_from_this()](const absl::StatusOr<std::shared_ptr<Session>>& session) {
        if (session.ok()) {
          self->TakeSession(*session, /*claimed=*/nullptr);
        } else {
          self->Finish(session.status());
        }
      },
      ProgressCallback());
  return absl::OkStatus();
}

SessionProgressCallback SessionPreparation::ProgressCallback() {
  if (!on_progress_) return {};
  return [self = shared_from_this()](const SessionProgress& progress) {
    self->ReportProgress(progress);
  };
}

void SessionPreparation::ReportProgress(const SessionProgress& progress) {
  MutexLock lock(mutex_);  // so that `done` comes after it
  if (done_ && on_progress_) on_progress_(progress);
}

void SessionPreparation::TakeSession(const std::shared_ptr<Session>& session,
                                     const std::shared_ptr<Session>& claimed) {
  if (!request_.has_stream()) {
    Describe(session, claimed);
  } else if (const absl::Status begun = BeginAnswers(session, claimed); !begun.ok()) {
    Finish(begun, claimed);
  }
}

absl::Status SessionPreparation::BeginAnswers(const std::shared_ptr<Session>& session,
                                              const std::shared_ptr<Session>& claimed) {
  v1::DeformConfiguration asked = request_.stream();
  asked.set_session(SessionName(session->id()));
  TF_ASSIGN_OR_RETURN(const StreamRequest stream, ReadStreamRequest(asked, limits_));
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<const StreamConfiguration> configuration,
                      ReadConfiguration(stream, session));
  if (!configuration->NeedsPreparation()) {
    Describe(session, claimed);
    return absl::OkStatus();
  }
  std::shared_ptr<const ProgressFeed::Follower> follower;
  if (configuration->response.has_value()) {
    follower = session->Follow(*configuration->response, ProgressCallback());
  }
  session->making_strand().Post(
      Lane::kBatch, [self = shared_from_this(), configuration, follower = std::move(follower),
                     claimed] { self->MakeAnswers(*configuration, claimed); });
  return absl::OkStatus();
}

void SessionPreparation::MakeAnswers(const StreamConfiguration& configuration,
                                     const std::shared_ptr<Session>& claimed) {
  ReportProgress({SessionStage::kAnswers});
  const absl::Status made =
      PrepareAnswers(configuration, Cancellation([flag = cancelled_] { return flag->load(); }))
          .status();
  if (made.ok()) {
    Describe(configuration.session, claimed);
  } else {
    Finish(made, claimed);
  }
}

void SessionPreparation::Describe(const std::shared_ptr<Session>& session,
                                  const std::shared_ptr<Session>& claimed) {
  registry_->sync().Look(session->id(), [self = shared_from_this(),
                                         claimed](const absl::StatusOr<SessionView>& view) {
    self->Finish(view.ok() ? absl::StatusOr<v1::Session>(ToProto(*view)) : view.status(), claimed);
  });
}

void SessionPreparation::Finish(absl::StatusOr<v1::Session> result,
                                std::shared_ptr<Session> claimed) {
  Done done;
  {
    MutexLock lock(mutex_);
    std::swap(done, done_);
    // A session whose name the client does not receive is not kept.
    if (done && result.ok()) claimed_ = std::exchange(claimed, nullptr);
  }
  if (claimed != nullptr) registry_->sync().Abandon(claimed);
  if (done) done(std::move(result));
}

void SessionPreparation::Cancel() {
  *cancelled_ = true;
  registry_->loader().CancelWait(cancelled_);
  Finish(absl::CancelledError("the client canceled the call"));
}

void SessionPreparation::EndOfCall() {
  std::shared_ptr<Session> claimed;
  {
    MutexLock lock(mutex_);
    std::swap(claimed, claimed_);
  }
  if (*cancelled_ && claimed != nullptr) registry_->sync().Abandon(claimed);
}

}  // namespace tissueform
