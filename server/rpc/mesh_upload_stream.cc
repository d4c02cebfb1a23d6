// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_upload_stream.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {

absl::Status MeshUploadStream::EndedEarly() const {
  return absl::InvalidArgumentError(
      absl::StrCat("the upload ended after ", upload_ == nullptr ? 0 : upload_->received_bytes(),
                   " bytes without finish_write; they are stored for a while: continue there"));
}

absl::Status MeshUploadStream::WasSilent() const {
  return WithReason(
      absl::DeadlineExceededError(absl::StrCat("no chunk came for ", silence().count(),
                                               " ms; call QueryUpload and continue "
                                               "on")),
      ErrorReason::kUploadSilent);
}

absl::StatusOr<MeshUploadStream::After> MeshUploadStream::Take(
    const v1::UploadMeshRequest& request) {
  if (upload_ == nullptr) return TakeHeader(request);
  if (!request.has_chunk()) {
    return absl::InvalidArgumentError("only chunks may follow the header");
  }
  const v1::MeshChunk& chunk = request.chunk();
  TF_RETURN_IF_ERROR(upload_->Write(chunk.write_offset(), chunk.data(), chunk.finish_write()));
  return chunk.finish_write() ? After::kCheck : After::kMore;
}

absl::StatusOr<MeshUploadStream::After> MeshUploadStream::TakeHeader(
    const v1::UploadMeshRequest& request) {
  if (!request.has_header()) {
    return absl::InvalidArgumentError("the first message must be the header");
  }
  UploadAnnouncement announcement = ToAnnouncement(request.header());
  const Principal& caller = scope().principal();
  announcement.owner = caller.name;
  sha256_ = announcement.sha256;
  scope().SetResource(MeshName(sha256_));
  const auto known = catalog_->Look(sha256_);
  // A store that was waited for in vain is not waited for once more, nor after the bytes.
  if (absl::IsUnavailable(known.status())) return known.status();
  // A caller without access does not learn that the mesh is here: only its bytes prove possession.
  const bool may_use = changes_->access().CheckMeshAccess(caller, sha256_, Permission::kRead).ok();
  if (may_use && known.ok()) {
    *response_->mutable_mesh() = ToProto(*known);
    response_->set_already_existed(true);
    response_->set_committed_bytes(announcement.total_bytes);
    return After::kEnd;
  }
  TF_RETURN_IF_ERROR(changes_->access().CheckStorageQuota(caller, announcement.total_bytes));
  TF_ASSIGN_OR_RETURN(upload_, uploads_->Open(std::move(announcement)));
  return After::kMore;
}

absl::Status MeshUploadStream::Check() {
  // Let go of at the end: a mesh that the client deletes at once is free at once.
  TF_ASSIGN_OR_RETURN(const auto stored, upload_->Finish());
  *response_->mutable_mesh() = ToProto(MeshView{RecordOf(*stored), stored});
  response_->set_committed_bytes(upload_->received_bytes());
  return changes_->GrantMesh(scope().principal(), sha256_, upload_->received_bytes());
}

}  // namespace tissueform
