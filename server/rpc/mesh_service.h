// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "server/access/access_changes.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/mesh_uploads.h"
#include "server/session/session_registry.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.MeshService over a catalog. Stateless; all arguments must outlive it.
class MeshService final : public v1::MeshService::CallbackService {
 public:
  MeshService(AdmissionControl* gate, const ServiceLimits& limits, AccessChanges* changes,
              MeshCatalog* catalog, MeshUploads* uploads, SessionRegistry* registry,
              WorkerPool* pool, DeadlineTimer* timer)
      : gate_(gate),
        limits_(limits),
        changes_(changes),
        catalog_(catalog),
        uploads_(uploads),
        registry_(registry),
        pool_(pool),
        timer_(timer) {}

  grpc::ServerReadReactor<v1::UploadMeshRequest>* UploadMesh(
      grpc::CallbackServerContext* context, v1::UploadMeshResponse* response) override;
  grpc::ServerUnaryReactor* QueryUpload(grpc::CallbackServerContext* context,
                                        const v1::QueryUploadRequest* request,
                                        v1::QueryUploadResponse* response) override;
  grpc::ServerUnaryReactor* GetMesh(grpc::CallbackServerContext* context,
                                    const v1::GetMeshRequest* request, v1::Mesh* response) override;
  grpc::ServerWriteReactor<v1::GetSurfaceResponse>* GetSurface(
      grpc::CallbackServerContext* context, const v1::GetSurfaceRequest* request) override;
  grpc::ServerUnaryReactor* ListMeshes(grpc::CallbackServerContext* context,
                                       const v1::ListMeshesRequest* request,
                                       v1::ListMeshesResponse* response) override;
  grpc::ServerUnaryReactor* DeleteMesh(grpc::CallbackServerContext* context,
                                       const v1::DeleteMeshRequest* request,
                                       google::protobuf::Empty* response) override;

 private:
  absl::Status FindUpload(const Principal& caller, const v1::QueryUploadRequest& request,
                          v1::QueryUploadResponse* response);
  absl::Status FindMesh(CallScope* scope, const v1::GetMeshRequest& request, v1::Mesh* response);
  absl::Status List(const Principal& caller, const v1::ListMeshesRequest& request,
                    v1::ListMeshesResponse* response);
  absl::Status RemoveMesh(CallScope* scope, const v1::DeleteMeshRequest& request);

  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  AccessChanges* const changes_;
  MeshCatalog* const catalog_;
  MeshUploads* const uploads_;
  SessionRegistry* const registry_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
