// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/resource_conversion.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/session_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.SessionService over a registry. Stateless; all pointers must outlive it.
class SessionService final : public v1::SessionService::CallbackService {
 public:
  SessionService(AdmissionControl* gate, const ServiceLimits& limits, Access* access,
                 MeshCatalog* catalog, SessionRegistry* registry,
                 const Clock* clock = Clock::System())
      : gate_(gate),
        limits_(limits),
        access_(access),
        catalog_(catalog),
        registry_(registry),
        clock_(clock) {}

  grpc::ServerUnaryReactor* CreateSession(grpc::CallbackServerContext* context,
                                          const v1::CreateSessionRequest* request,
                                          v1::Session* response) override;
  grpc::ServerUnaryReactor* GetSession(grpc::CallbackServerContext* context,
                                       const v1::GetSessionRequest* request,
                                       v1::Session* response) override;
  grpc::ServerUnaryReactor* ListSessions(grpc::CallbackServerContext* context,
                                         const v1::ListSessionsRequest* request,
                                         v1::ListSessionsResponse* response) override;
  grpc::ServerUnaryReactor* UpdateSession(grpc::CallbackServerContext* context,
                                          const v1::UpdateSessionRequest* request,
                                          v1::Session* response) override;
  grpc::ServerWriteReactor<v1::PrepareSessionResponse>* PrepareSession(
      grpc::CallbackServerContext* context, const v1::PrepareSessionRequest* request) override;
  grpc::ServerUnaryReactor* DeleteSession(grpc::CallbackServerContext* context,
                                          const v1::DeleteSessionRequest* request,
                                          google::protobuf::Empty* response) override;

 private:
  // Blocks on the store, then ends the call.
  void ListSessionsOf(const Principal& caller, const PageRequest& page,
                      v1::ListSessionsResponse* response, const FinishCall& end);

  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  MeshCatalog* const catalog_;
  SessionRegistry* const registry_;
  const Clock* const clock_;
};

}  // namespace tissueform
