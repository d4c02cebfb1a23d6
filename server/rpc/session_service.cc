// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/session_service.h"

#include <memory>
#include <set>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/prepare_session_stream.h"
#include "server/rpc/resource_conversion.h"
#include "server/rpc/session_preparation.h"

namespace tissueform {
namespace {

// One CreateSession or UpdateSession call. Deletes itself when gRPC is done with it.
class PreparationCall : public grpc::ServerUnaryReactor {
 public:
  PreparationCall(CallScope scope, const ServiceLimits& limits, Access* access,
                  MeshCatalog* catalog, SessionRegistry* registry,
                  v1::PrepareSessionRequest request, v1::Session* response)
      : scope_(std::move(scope)),
        preparation_(std::make_shared<SessionPreparation>(
            limits, access, catalog, registry, std::move(request), /*on_progress=*/nullptr,
            [this](const std::string& resource) { scope_.SetResource(resource); },
            [this, response](absl::StatusOr<v1::Session> session) {
              const absl::Status outcome = session.status();
              if (session.ok()) {
                scope_.SetResource(session->name());
                *response = *std::move(session);
              }
              Finish(scope_.End(outcome));
            })) {}

  void Start() { preparation_->Start(scope_.admission(), scope_.principal()); }

  void OnCancel() override { preparation_->Cancel(); }

  void OnDone() override {
    preparation_->EndOfCall();
    delete this;
  }

 private:
  CallScope scope_;
  const std::shared_ptr<SessionPreparation> preparation_;
};

}  // namespace

grpc::ServerUnaryReactor* SessionService::CreateSession(grpc::CallbackServerContext* context,
                                                        const v1::CreateSessionRequest* request,
                                                        v1::Session* response) {
  v1::PrepareSessionRequest preparation;
  *preparation.mutable_create() = *request;
  auto* call = new PreparationCall(
      CallScope(context, "SessionService.CreateSession", CallKind::kNewWork, gate_), limits_,
      access_, catalog_, registry_, std::move(preparation), response);
  call->Start();
  return call;
}

grpc::ServerUnaryReactor* SessionService::GetSession(grpc::CallbackServerContext* context,
                                                     const v1::GetSessionRequest* request,
                                                     v1::Session* response) {
  return HandleUnaryCallIn(
      Lane::kLeases, &registry_->pool(), context, "SessionService.GetSession", gate_,
      [=, this](CallScope& scope, const FinishCall& end) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const std::string id,
                            AllowedSession(access_, &scope, request->name(), Permission::kRead));
        registry_->sync().Look(id, [end, response](const absl::StatusOr<SessionView>& view) {
          if (view.ok()) *response = ToProto(*view);
          end(view.status());
        });
        return absl::OkStatus();
      });
}

grpc::ServerUnaryReactor* SessionService::ListSessions(grpc::CallbackServerContext* context,
                                                       const v1::ListSessionsRequest* request,
                                                       v1::ListSessionsResponse* response) {
  return HandleUnaryCall(
      context, "SessionService.ListSessions", gate_,
      [=, this](CallScope& scope, const FinishCall& end) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const PageRequest page,
                            ReadPageRequest(request->page_size(), request->page_token()));
        registry_->pool().Post(Lane::kStore, [=, this, caller = scope.principal()] {
          ListSessionsOf(caller, page, response, end);
        });
        return absl::OkStatus();
      });
}

void SessionService::ListSessionsOf(const Principal& caller, const PageRequest& page,
                                    v1::ListSessionsResponse* response, const FinishCall& end) {
  absl::StatusOr<std::set<std::string>> shared = access_->SharedSessions(caller);
  if (!shared.ok()) {
    end(shared.status());
    return;
  }
  registry_->sync().List(
      {.owner = caller.name, .also = *std::move(shared), .after = page.after, .limit = page.size},
      [end, response](const absl::StatusOr<SessionViewPage>& views) {
        if (views.ok()) {
          for (const SessionView& view : views->views) {
            *response->add_sessions() = ToProto(view);
          }
          response->set_next_page_token(views->next);
        }
        end(views.status());
      });
}

grpc::ServerUnaryReactor* SessionService::UpdateSession(grpc::CallbackServerContext* context,
                                                        const v1::UpdateSessionRequest* request,
                                                        v1::Session* response) {
  v1::PrepareSessionRequest preparation;
  *preparation.mutable_update() = *request;
  auto* call = new PreparationCall(
      CallScope(context, "SessionService.UpdateSession", CallKind::kNewWork, gate_), limits_,
      access_, catalog_, registry_, std::move(preparation), response);
  call->Start();
  return call;
}

grpc::ServerWriteReactor<v1::PrepareSessionResponse>* SessionService::PrepareSession(
    grpc::CallbackServerContext* context, const v1::PrepareSessionRequest* request) {
  return new PrepareSessionStream(
      CallScope(context, "SessionService.PrepareSession", CallKind::kNewWork, gate_), limits_,
      access_, catalog_, registry_, *request, clock_);
}

grpc::ServerUnaryReactor* SessionService::DeleteSession(grpc::CallbackServerContext* context,
                                                        const v1::DeleteSessionRequest* request,
                                                        google::protobuf::Empty* /*response*/) {
  return HandleUnaryCallIn(
      Lane::kLeases, &registry_->pool(), context, "SessionService.DeleteSession", gate_,
      [=, this](CallScope& scope, const FinishCall& end) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const std::string id,
                            AllowedSession(access_, &scope, request->name(), Permission::kOwner));
        registry_->sync().Delete(id, end);
        return absl::OkStatus();
      });
}

}  // namespace tissueform
