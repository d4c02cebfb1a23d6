// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_upload_stream.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {

MeshUploadStream::MeshUploadStream(CallScope scope, MeshCatalog* catalog, WorkerPool* pool,
                                   v1::UploadMeshResponse* response)
    : scope_(std::move(scope)), catalog_(catalog), pool_(pool), response_(response) {
  if (scope_.admission().ok()) {
    StartRead(&request_);
  } else {
    End(scope_.admission());
  }
}

void MeshUploadStream::OnReadDone(bool ok) {
  if (!ok) {
    End(absl::InvalidArgumentError(
        absl::StrCat("the upload ended after ", upload_ == nullptr ? 0 : upload_->committed_bytes(),
                     " bytes without a chunk that has finish_write; send the whole mesh, in chunks "
                     "of 1 MiB at most")));
    return;
  }
  if (const absl::Status status = Take(); !status.ok()) {
    End(status);
  } else if (upload_ == nullptr) {
    End(absl::OkStatus());  // the server has the mesh already
  } else if (upload_->finished()) {
    CheckOnWorker();
  } else {
    StartRead(&request_);
  }
}

absl::Status MeshUploadStream::Take() {
  if (upload_ == nullptr) {
    return TakeHeader();
  }
  if (!request_.has_chunk()) {
    return absl::InvalidArgumentError("only chunks may follow the header");
  }
  const v1::MeshChunk& chunk = request_.chunk();
  return upload_->Write(chunk.write_offset(), chunk.data(), chunk.finish_write());
}

absl::Status MeshUploadStream::TakeHeader() {
  if (!request_.has_header()) {
    return absl::InvalidArgumentError("the first message must be the header");
  }
  MeshAnnouncement announcement = ToAnnouncement(request_.header());
  if (const auto known = catalog_->Find(announcement.sha256); known != nullptr) {
    *response_->mutable_mesh() = ToProto(*known);
    response_->set_already_existed(true);
    response_->set_committed_bytes(announcement.total_bytes);
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(upload_, catalog_->StartUpload(std::move(announcement)));
  return absl::OkStatus();
}

void MeshUploadStream::CheckOnWorker() {
  pool_->Post([this] {
    const int64_t committed_bytes = upload_->committed_bytes();
    auto stored = catalog_->Finish(std::move(upload_));
    const absl::Status outcome = stored.status();
    if (stored.ok()) {
      *response_->mutable_mesh() = ToProto(**stored);
      response_->set_committed_bytes(committed_bytes);
      // Before the client has its answer: a mesh that it deletes at once is free at once.
      stored->reset();
    }
    End(outcome);
  });
}

void MeshUploadStream::End(const absl::Status& outcome) {
  upload_.reset();
  Finish(scope_.End(outcome));
}

}  // namespace tissueform
