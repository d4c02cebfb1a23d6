// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_service.h"

#include <cstddef>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/mesh_surface.h"
#include "server/rpc/mesh_upload_stream.h"
#include "server/rpc/resource_conversion.h"
#include "server/session/session_errors.h"

namespace tissueform {
namespace {

// What one GetSurface call sends, as far as it has come.
struct SurfaceToSend {
  MeshSurface surface;
  MemoryReservation reservation;
  bool header_sent = false;
  size_t offset = 0;
};

// Blocks on the disk, and computes.
absl::StatusOr<std::shared_ptr<SurfaceToSend>> MakeSurface(const v1::GetSurfaceRequest& request,
                                                           Access* access, CallScope* scope,
                                                           MeshCatalog* catalog) {
  TF_ASSIGN_OR_RETURN(const std::string sha256,
                      AllowedMesh(access, scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<const StoredMesh> mesh, catalog->Load(sha256));
  TF_ASSIGN_OR_RETURN(const std::vector<const CellArray*> arrays,
                      FindSurfaceArrays(*mesh, request.cell_arrays()));
  auto to_send = std::make_shared<SurfaceToSend>();
  TF_ASSIGN_OR_RETURN(to_send->reservation,
                      catalog->budget()->Reserve(SurfaceBytes(*mesh, arrays.size()), "surface"));
  to_send->surface = EncodeSurface(*mesh, arrays);
  return to_send;
}

bool NextOfSurface(SurfaceToSend* to_send, v1::GetSurfaceResponse* message) {
  if (!std::exchange(to_send->header_sent, true)) {
    *message->mutable_header() = to_send->surface.header;
    return true;
  }
  return NextSurfaceChunk(to_send->surface.bytes, &to_send->offset, message->mutable_chunk());
}

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* MeshService::UploadMesh(
    grpc::CallbackServerContext* context, v1::UploadMeshResponse* response) {
  auto* call =
      new MeshUploadStream(CallScope(context, "MeshService.UploadMesh", CallKind::kNewWork, gate_),
                           limits_, changes_, catalog_, uploads_, pool_, timer_, response);
  call->Start();
  return call;
}

grpc::ServerUnaryReactor* MeshService::QueryUpload(grpc::CallbackServerContext* context,
                                                   const v1::QueryUploadRequest* request,
                                                   v1::QueryUploadResponse* response) {
  return HandleStoreCall(
      context, "MeshService.QueryUpload", gate_, pool_,
      [=, this](CallScope* scope) { return FindUpload(scope->principal(), *request, response); });
}

grpc::ServerUnaryReactor* MeshService::GetMesh(grpc::CallbackServerContext* context,
                                               const v1::GetMeshRequest* request,
                                               v1::Mesh* response) {
  return HandleStoreCall(context, "MeshService.GetMesh", gate_, pool_, [=, this](CallScope* scope) {
    return FindMesh(scope, *request, response);
  });
}

grpc::ServerWriteReactor<v1::GetSurfaceResponse>* MeshService::GetSurface(
    grpc::CallbackServerContext* context, const v1::GetSurfaceRequest* request) {
  auto* call = new MessageStream<v1::GetSurfaceResponse>(
      CallScope(context, "MeshService.GetSurface", CallKind::kNewWork, gate_), CancelOf(context),
      timer_, limits_.upload_silence);
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  pool_->Post(Lane::kStore, [call, request, access = &changes_->access(), catalog = catalog_] {
    absl::StatusOr<std::shared_ptr<SurfaceToSend>> made =
        MakeSurface(*request, access, &call->scope(), catalog);
    if (!made.ok()) {
      call->End(made.status());
      return;
    }
    call->Send([to_send = *std::move(made)](v1::GetSurfaceResponse* message) {
      return NextOfSurface(to_send.get(), message);
    });
  });
  return call;
}

grpc::ServerUnaryReactor* MeshService::ListMeshes(grpc::CallbackServerContext* context,
                                                  const v1::ListMeshesRequest* request,
                                                  v1::ListMeshesResponse* response) {
  return HandleStoreCall(
      context, "MeshService.ListMeshes", gate_, pool_,
      [=, this](CallScope* scope) { return List(scope->principal(), *request, response); });
}

grpc::ServerUnaryReactor* MeshService::DeleteMesh(grpc::CallbackServerContext* context,
                                                  const v1::DeleteMeshRequest* request,
                                                  google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(context, "MeshService.DeleteMesh", gate_, pool_,
                         [=, this](CallScope* scope) { return RemoveMesh(scope, *request); });
}

absl::Status MeshService::FindUpload(const Principal& caller, const v1::QueryUploadRequest& request,
                                     v1::QueryUploadResponse* response) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseMeshName(request.name()));
  TF_ASSIGN_OR_RETURN(const UploadProgress progress, uploads_->Query(sha256, caller.name));
  response->set_committed_bytes(progress.committed_bytes);
  response->set_total_bytes(progress.total_bytes);
  return absl::OkStatus();
}

absl::Status MeshService::FindMesh(CallScope* scope, const v1::GetMeshRequest& request,
                                   v1::Mesh* response) {
  TF_ASSIGN_OR_RETURN(const std::string sha256,
                      AllowedMesh(&changes_->access(), scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(const MeshView mesh, catalog_->Look(sha256));
  *response = ToProto(mesh);
  return absl::OkStatus();
}

absl::Status MeshService::List(const Principal& caller, const v1::ListMeshesRequest& request,
                               v1::ListMeshesResponse* response) {
  TF_ASSIGN_OR_RETURN(const PageRequest page,
                      ReadPageRequest(request.page_size(), request.page_token()));
  using Names = std::optional<std::set<std::string>>;
  TF_ASSIGN_OR_RETURN(const Names near, changes_->access().MeshesNear(caller));
  std::string last;
  std::string after = page.after;
  do {
    TF_ASSIGN_OR_RETURN(const MeshViewPage views, catalog_->List(after, page.size));
    for (const MeshView& view : views.views) {
      const std::string& sha256 = view.record.sha256;
      if (near.has_value() && !near->contains(sha256)) continue;
      if (!changes_->access().CheckMeshAccess(caller, sha256, Permission::kRead).ok()) continue;
      if (response->meshes_size() == page.size) {
        response->set_next_page_token(last);
        return absl::OkStatus();
      }
      *response->add_meshes() = ToProto(view);
      last = view.record.sha256;
    }
    after = views.next;
  } while (!after.empty());
  return absl::OkStatus();
}

// Other users who have sent the same bytes keep the mesh, and the caller does not learn of them.
absl::Status MeshService::RemoveMesh(CallScope* scope, const v1::DeleteMeshRequest& request) {
  Access& access = changes_->access();
  TF_ASSIGN_OR_RETURN(const std::string sha256,
                      AllowedMesh(&access, scope, request.name(), Permission::kRead));
  const Principal& caller = scope->principal();
  // A prediction may hold the name of one that has gone.
  TF_RETURN_IF_ERROR(catalog_->Look(sha256).status());
  TF_RETURN_IF_ERROR(access.CheckMeshAccess(caller, sha256, Permission::kOwner));
  TF_ASSIGN_OR_RETURN(const MeshUse use, access.FindMeshUse(sha256));
  const auto own_sessions = use.sessions.find(caller.name);
  const bool has_sessions = own_sessions != use.sessions.end();
  const bool others_hold = use.senders.size() > (use.senders.contains(caller.name) ? 1U : 0U) ||
                           use.sessions.size() > (has_sessions ? 1U : 0U);
  if (!others_hold) return registry_->table().RemoveMesh(sha256);
  if (has_sessions) return MeshInUse(static_cast<int>(own_sessions->second));
  return changes_->ReleaseMesh(caller, sha256);
}

}  // namespace tissueform
