// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/mesh_uploads.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

absl::Status OutOfPlace(int64_t offset, int64_t received, bool first) {
  return WithReason(
      absl::InvalidArgumentError(absl::StrCat(
          "chunk begins at ", offset, ", but ", received, " bytes of this mesh are there",
          first && received > 0 ? "; continue there, or start again at 0"
                                : "; send chunks without gaps, in order, from there")),
      ErrorReason::kChunkOutOfPlace, {{"committed_bytes", absl::StrCat(received)}});
}

}  // namespace

MeshUpload::MeshUpload(MeshUploads* uploads, UploadAnnouncement announced)
    : uploads_(uploads), announced_(std::move(announced)) {}

MeshUpload::~MeshUpload() {
  UploadStore& store = *uploads_->store_;
  const absl::StatusOr<int64_t> committed = store.Committed(PartName(announced_));
  // Many of them would fill all places with nothing.
  if (committed.ok() && *committed == 0) store.Drop(PartName(announced_)).IgnoreError();
  if (!committed.ok() && !absl::IsNotFound(committed.status())) {
    spdlog::warn("an upload starts again: {}", committed.status().ToString());
  }
  uploads_->Release(PartName(announced_));
}

absl::Status MeshUpload::BeginAnew() {
  TF_RETURN_IF_ERROR(uploads_->store_->Drop(PartName(announced_)));
  TF_ASSIGN_OR_RETURN(received_bytes_, uploads_->store_->Begin(announced_));
  return absl::OkStatus();
}

absl::Status MeshUpload::Write(int64_t offset, absl::string_view data, bool last) {
  const auto size = static_cast<int64_t>(data.size());
  const int64_t total_bytes = announced_.total_bytes;
  if (size > uploads_->limits_.max_chunk_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("chunk at ", offset, " has ", size,
                                                   " bytes; send ",
                                                   uploads_->limits_.max_chunk_bytes, " at most"));
  }
  const bool anew = first_ && offset == 0 && received_bytes_ > 0;
  if (offset != received_bytes_ && !anew) return OutOfPlace(offset, received_bytes_, first_);
  if (size > total_bytes - offset) {
    return absl::InvalidArgumentError(absl::StrCat("chunk at ", offset, " with ", size,
                                                   " bytes exceeds the ", total_bytes,
                                                   " declared bytes"));
  }
  if (anew) TF_RETURN_IF_ERROR(BeginAnew());
  first_ = false;
  if (size > 0) TF_RETURN_IF_ERROR(uploads_->store_->Append(PartName(announced_), offset, data));
  received_bytes_ += size;
  if (last && received_bytes_ != total_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("finish_write after ", received_bytes_, " of ",
                                                   total_bytes, " declared bytes; send the rest"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const StoredMesh>> MeshUpload::Finish() {
  UploadStore& store = *uploads_->store_;
  auto stored = uploads_->catalog_->Admit(
      announced_, [&store, this] { return store.Read(PartName(announced_)); });
  const absl::Status& status = stored.status();
  if (status.ok() || absl::IsDataLoss(status) || absl::IsInvalidArgument(status)) {
    if (const absl::Status dropped = store.Drop(PartName(announced_)); !dropped.ok()) {
      spdlog::warn("an incomplete upload remains for a day: {}", dropped.ToString());
    }
  }
  return stored;
}

absl::StatusOr<std::unique_ptr<MeshUpload>> MeshUploads::Open(UploadAnnouncement announced) {
  TF_RETURN_IF_ERROR(catalog_->Check(announced));
  TF_RETURN_IF_ERROR(Claim(PartName(announced)));
  std::unique_ptr<MeshUpload> upload(new MeshUpload(this, std::move(announced)));
  TF_ASSIGN_OR_RETURN(upload->received_bytes_, store_->Begin(upload->announced_));
  return upload;
}

absl::StatusOr<UploadProgress> MeshUploads::Query(const std::string& sha256,
                                                  const std::string& owner) {
  const std::string part =
      PartName({.shape = {}, .total_bytes = 0, .sha256 = sha256, .owner = owner});
  const absl::StatusOr<UploadAnnouncement> announced = store_->Announced(part);
  if (absl::IsNotFound(announced.status())) return NoUpload(sha256);
  TF_RETURN_IF_ERROR(announced.status());
  TF_ASSIGN_OR_RETURN(const int64_t committed_bytes, store_->Committed(part));
  return UploadProgress{committed_bytes, announced->total_bytes};
}

absl::Status MeshUploads::Claim(const std::string& part_name) {
  MutexLock lock(mutex_);
  if (!claimed_.insert(part_name).second) {
    return WithReason(absl::AbortedError("another client is sending this mesh; wait and try again"),
                      ErrorReason::kUploadUnderWay);
  }
  return absl::OkStatus();
}

void MeshUploads::Release(const std::string& part_name) {
  MutexLock lock(mutex_);
  claimed_.erase(part_name);
}

}  // namespace tissueform
