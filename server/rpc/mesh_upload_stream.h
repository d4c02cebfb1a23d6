// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "server/rpc/call_scope.h"
#include "server/session/mesh_catalog.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// One UploadMesh call. Deletes itself when gRPC is done with it.
//
// Either a read is under way or the worker checks the mesh, never both: what runs is alone.
class MeshUploadStream : public grpc::ServerReadReactor<v1::UploadMeshRequest> {
 public:
  // `response` belongs to gRPC and lives as long as the call.
  MeshUploadStream(CallScope scope, MeshCatalog* catalog, WorkerPool* pool,
                   v1::UploadMeshResponse* response);

  void OnReadDone(bool ok) override;
  void OnDone() override { delete this; }

 private:
  // Takes the message in request_. OK when the next one may come.
  absl::Status Take();
  absl::Status TakeHeader();
  void CheckOnWorker();
  // Gives back the memory first, so that it is free when the client hears of the end.
  void End(const absl::Status& outcome);

  CallScope scope_;
  MeshCatalog* const catalog_;
  WorkerPool* const pool_;
  v1::UploadMeshResponse* const response_;
  v1::UploadMeshRequest request_;
  std::unique_ptr<MeshUpload> upload_;  // null before the header
};

}  // namespace tissueform
