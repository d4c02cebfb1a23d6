// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/session_service.h"

#include <atomic>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

// One CreateSession call. Deletes itself when gRPC is done with it.
class CreateSessionCall : public grpc::ServerUnaryReactor {
 public:
  CreateSessionCall(CallScope scope, const ServiceLimits& limits, MeshCatalog* catalog,
                    SessionRegistry* registry, const v1::CreateSessionRequest* request,
                    v1::Session* response)
      : scope_(std::move(scope)),
        limits_(limits),
        catalog_(catalog),
        registry_(registry),
        request_(*request),
        response_(response) {}

  void Start() {
    const absl::StatusOr<std::string> sha256 =
        scope_.admission().ok() ? ParseMeshName(request_.mesh())
                                : absl::StatusOr<std::string>(scope_.admission());
    if (!sha256.ok()) {
      End(sha256.status());
    } else if (auto mesh = catalog_->Find(*sha256); mesh != nullptr) {
      Make(std::move(mesh));
    } else {
      registry_->pool().Post(Lane::kStore, [this, sha256 = *sha256] {
        absl::StatusOr<std::shared_ptr<const StoredMesh>> loaded = catalog_->Load(sha256);
        if (loaded.ok()) {
          Make(*std::move(loaded));
        } else {
          End(loaded.status());
        }
      });
    }
  }

  void Make(std::shared_ptr<const StoredMesh> mesh) {
    absl::StatusOr<SessionRecord> record =
        ToSessionRecord(request_, *mesh, scope_.principal(), limits_);
    if (!record.ok()) {
      End(record.status());
      return;
    }
    registry_->Create(*std::move(record), std::move(mesh), cancelled_,
                      [this](absl::StatusOr<std::shared_ptr<Session>> result) {
                        const absl::Status outcome = result.status();
                        if (!result.ok()) {
                          End(outcome);
                          return;
                        }
                        session_ = *std::move(result);
                        Describe();
                      });
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->CancelWait(cancelled_);
  }

  // Once more from the store, which knows the etag and the times.
  void Describe() {
    registry_->Look(session_->id(), [this](const absl::StatusOr<SessionRegistry::View>& view) {
      if (view.ok()) *response_ = ToProto(*view);
      End(view.status());
    });
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
  const ServiceLimits& limits_;
  MeshCatalog* const catalog_;
  SessionRegistry* const registry_;
  const v1::CreateSessionRequest& request_;
  v1::Session* const response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  std::shared_ptr<Session> session_;  // written before Finish, read after it
};

// One UpdateSession call. Deletes itself when gRPC is done with it.
class UpdateSessionCall : public grpc::ServerUnaryReactor {
 public:
  UpdateSessionCall(CallScope scope, const ServiceLimits& limits, SessionRegistry* registry,
                    const v1::UpdateSessionRequest* request, v1::Session* response)
      : scope_(std::move(scope)),
        limits_(limits),
        registry_(registry),
        request_(*request),
        response_(response) {}

  void Start() {
    if (const absl::Status status = Begin(); !status.ok()) End(status);
  }

  void OnCancel() override { *cancelled_ = true; }
  void OnDone() override { delete this; }

 private:
  absl::Status Begin() {
    TF_RETURN_IF_ERROR(scope_.admission());
    TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request_.name()));
    TF_RETURN_IF_ERROR(CheckNamesSomething(request_));
    registry_->Update(
        id, request_.etag(),
        [this](SessionRecord record, const StoredMesh& mesh) {
          return ToUpdatedRecord(request_, std::move(record), mesh, limits_);
        },
        cancelled_,
        [this](const absl::StatusOr<SessionRegistry::View>& view) {
          if (view.ok()) *response_ = ToProto(*view);
          End(view.status());
        });
    return absl::OkStatus();
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  CallScope scope_;
  const ServiceLimits& limits_;
  SessionRegistry* const registry_;
  const v1::UpdateSessionRequest& request_;
  v1::Session* const response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
};

}  // namespace

grpc::ServerUnaryReactor* SessionService::CreateSession(grpc::CallbackServerContext* context,
                                                        const v1::CreateSessionRequest* request,
                                                        v1::Session* response) {
  auto* call = new CreateSessionCall(
      CallScope(context, "SessionService.CreateSession", CallKind::kNewWork, gate_), limits_,
      catalog_, registry_, request, response);
  call->Start();
  return call;
}

grpc::ServerUnaryReactor* SessionService::GetSession(grpc::CallbackServerContext* context,
                                                     const v1::GetSessionRequest* request,
                                                     v1::Session* response) {
  return RunUpkeep(context, "SessionService.GetSession", gate_,
                   [=, this](const CallScope& /*scope*/, const EndCall& end) -> absl::Status {
                     TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request->name()));
                     registry_->Look(
                         id, [end, response](const absl::StatusOr<SessionRegistry::View>& view) {
                           if (view.ok()) *response = ToProto(*view);
                           end(view.status());
                         });
                     return absl::OkStatus();
                   });
}

grpc::ServerUnaryReactor* SessionService::ListSessions(grpc::CallbackServerContext* context,
                                                       const v1::ListSessionsRequest* request,
                                                       v1::ListSessionsResponse* response) {
  return RunUpkeep(
      context, "SessionService.ListSessions", gate_,
      [=, this](const CallScope& scope, const EndCall& end) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const PageRequest page,
                            ReadPageRequest(request->page_size(), request->page_token()));
        registry_->List({.owner = scope.principal().name, .after = page.after, .limit = page.size},
                        [end, response](const absl::StatusOr<SessionRegistry::ViewPage>& views) {
                          if (views.ok()) {
                            for (const SessionRegistry::View& view : views->views) {
                              *response->add_sessions() = ToProto(view);
                            }
                            response->set_next_page_token(views->next);
                          }
                          end(views.status());
                        });
        return absl::OkStatus();
      });
}

grpc::ServerUnaryReactor* SessionService::UpdateSession(grpc::CallbackServerContext* context,
                                                        const v1::UpdateSessionRequest* request,
                                                        v1::Session* response) {
  auto* call = new UpdateSessionCall(
      CallScope(context, "SessionService.UpdateSession", CallKind::kNewWork, gate_), limits_,
      registry_, request, response);
  call->Start();
  return call;
}

grpc::ServerUnaryReactor* SessionService::DeleteSession(grpc::CallbackServerContext* context,
                                                        const v1::DeleteSessionRequest* request,
                                                        google::protobuf::Empty* /*response*/) {
  return RunUpkeep(context, "SessionService.DeleteSession", gate_,
                   [=, this](const CallScope& /*scope*/, const EndCall& end) -> absl::Status {
                     TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request->name()));
                     registry_->Delete(id, end);
                     return absl::OkStatus();
                   });
}

}  // namespace tissueform
