// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/session_service.h"

#include <atomic>
#include <memory>
#include <utility>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

// One CreateSession call. Deletes itself when gRPC is done with it.
class CreateSessionCall : public grpc::ServerUnaryReactor {
 public:
  CreateSessionCall(CallScope scope, SessionRegistry* registry, v1::Session* response)
      : scope_(std::move(scope)), registry_(registry), response_(response) {}

  void Start(SessionRecord record, std::shared_ptr<const StoredMesh> mesh) {
    registry_->Create(std::move(record), std::move(mesh), cancelled_,
                      [this](absl::StatusOr<std::shared_ptr<Session>> result) {
                        const absl::Status outcome = result.status();
                        if (result.ok()) {
                          session_ = *std::move(result);
                          *response_ = ToProto(*session_);
                        }
                        End(outcome);
                      });
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->CancelCreate(cancelled_);
  }

  // A client that has cancelled never learns the name of its session: nobody would ever delete it.
  void OnDone() override {
    if (*cancelled_ && session_ != nullptr) {
      registry_->Abandon(session_);
    }
    delete this;
  }

 private:
  CallScope scope_;
  SessionRegistry* const registry_;
  v1::Session* const response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  std::shared_ptr<Session> session_;  // written before Finish, read after it
};

}  // namespace

grpc::ServerUnaryReactor* SessionService::CreateSession(grpc::CallbackServerContext* context,
                                                        const v1::CreateSessionRequest* request,
                                                        v1::Session* response) {
  CallScope scope(context, "SessionService.CreateSession", CallKind::kNewWork, gate_);
  absl::StatusOr<Creation> creation = scope.admission().ok()
                                          ? ReadRequest(scope, *request)
                                          : absl::StatusOr<Creation>(scope.admission());
  auto* call = new CreateSessionCall(std::move(scope), registry_, response);
  if (creation.ok()) {
    call->Start(std::move(creation->record), std::move(creation->mesh));
  } else {
    call->End(creation.status());
  }
  return call;
}

grpc::ServerUnaryReactor* SessionService::GetSession(grpc::CallbackServerContext* context,
                                                     const v1::GetSessionRequest* request,
                                                     v1::Session* response) {
  CallScope scope(context, "SessionService.GetSession", CallKind::kUpkeep, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(
      scope.End(scope.admission().ok() ? FindSession(*request, response) : scope.admission()));
  return reactor;
}

grpc::ServerUnaryReactor* SessionService::DeleteSession(grpc::CallbackServerContext* context,
                                                        const v1::DeleteSessionRequest* request,
                                                        google::protobuf::Empty* /*response*/) {
  auto scope = std::make_shared<CallScope>(context, "SessionService.DeleteSession",
                                           CallKind::kUpkeep, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::StatusOr<std::string> id = scope->admission().ok()
                                             ? ParseSessionName(request->name())
                                             : absl::StatusOr<std::string>(scope->admission());
  if (!id.ok()) {
    reactor->Finish(scope->End(id.status()));
    return reactor;
  }
  registry_->Delete(
      *id, [reactor, scope](const absl::Status& status) { reactor->Finish(scope->End(status)); });
  return reactor;
}

absl::StatusOr<SessionService::Creation> SessionService::ReadRequest(
    const CallScope& scope, const v1::CreateSessionRequest& request) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(request.mesh()));
  Creation creation;
  creation.mesh = catalog_->Find(sha256);
  if (creation.mesh == nullptr) {
    return WithReason(
        absl::NotFoundError("the server does not have the mesh of this request; upload it"),
        ErrorReason::kMeshNotFound);
  }
  TF_ASSIGN_OR_RETURN(creation.record,
                      ToSessionRecord(request, *creation.mesh, scope.principal(), limits_));
  return creation;
}

absl::Status SessionService::FindSession(const v1::GetSessionRequest& request,
                                         v1::Session* response) {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request.name()));
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Session> session, registry_->Find(id));
  *response = ToProto(*session);
  return absl::OkStatus();
}

}  // namespace tissueform
