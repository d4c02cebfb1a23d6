// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/access/access_changes.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/calls/upload_stream.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/mesh_uploads.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// One UploadMesh call; Start it.
class MeshUploadStream final : public UploadStream<v1::UploadMeshRequest> {
 public:
  // `response` belongs to gRPC and lives as long as the call.
  MeshUploadStream(CallScope scope, const ServiceLimits& limits, AccessChanges* changes,
                   MeshCatalog* catalog, MeshUploads* uploads, WorkerPool* pool,
                   DeadlineTimer* timer, v1::UploadMeshResponse* response)
      : UploadStream(std::move(scope), limits.upload_silence, Lane::kBatch, pool, timer),
        changes_(changes),
        catalog_(catalog),
        uploads_(uploads),
        response_(response) {}

 protected:
  absl::StatusOr<After> Take(const v1::UploadMeshRequest& request) override;
  absl::Status Check() override;
  void Close() override { upload_.reset(); }
  absl::Status EndedEarly() const override;
  absl::Status WasSilent() const override;

 private:
  absl::StatusOr<After> TakeHeader(const v1::UploadMeshRequest& request);

  // Constant.
  AccessChanges* const changes_;
  MeshCatalog* const catalog_;
  MeshUploads* const uploads_;
  v1::UploadMeshResponse* const response_;

  // The job's alone.
  std::string sha256_;                  // that the header states
  std::unique_ptr<MeshUpload> upload_;  // null before the header
};

}  // namespace tissueform
