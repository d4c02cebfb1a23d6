// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_service.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "server/rpc/mesh_upload_stream.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

absl::Status NoSuchMesh() {
  return WithReason(absl::NotFoundError("the server does not have this mesh; upload it"),
                    ErrorReason::kMeshNotFound);
}

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* MeshService::UploadMesh(
    grpc::CallbackServerContext* context, v1::UploadMeshResponse* response) {
  return new MeshUploadStream(
      CallScope(context, "MeshService.UploadMesh", CallKind::kNewWork, gate_), limits_, catalog_,
      pool_, timer_, response);
}

grpc::ServerUnaryReactor* MeshService::GetMesh(grpc::CallbackServerContext* context,
                                               const v1::GetMeshRequest* request,
                                               v1::Mesh* response) {
  CallScope scope(context, "MeshService.GetMesh", CallKind::kUpkeep, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(
      scope.End(scope.admission().ok() ? FindMesh(*request, response) : scope.admission()));
  return reactor;
}

grpc::ServerUnaryReactor* MeshService::DeleteMesh(grpc::CallbackServerContext* context,
                                                  const v1::DeleteMeshRequest* request,
                                                  google::protobuf::Empty* /*response*/) {
  CallScope scope(context, "MeshService.DeleteMesh", CallKind::kUpkeep, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(scope.End(scope.admission().ok() ? RemoveMesh(*request) : scope.admission()));
  return reactor;
}

absl::Status MeshService::FindMesh(const v1::GetMeshRequest& request, v1::Mesh* response) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(request.name()));
  const auto mesh = catalog_->Find(sha256);
  if (mesh == nullptr) {
    return NoSuchMesh();
  }
  *response = ToProto(*mesh);
  return absl::OkStatus();
}

absl::Status MeshService::RemoveMesh(const v1::DeleteMeshRequest& request) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(request.name()));
  return catalog_->Remove(sha256) ? absl::OkStatus() : NoSuchMesh();
}

}  // namespace tissueform
