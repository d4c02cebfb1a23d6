// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/build_file_upload_stream.h"

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/plan_build_conversion.h"
#include "server/builds/plan_builder.h"

namespace tissueform {

v1::BuildFile ToProto(const BuildFileRecord& record, int64_t expires_s) {
  v1::BuildFile proto;
  proto.set_name(BuildFileName(record.sha256));
  proto.set_suffix(record.suffix);
  proto.set_total_bytes(record.total_bytes);
  proto.set_committed_bytes(record.committed_bytes);
  proto.mutable_create_time()->set_seconds(record.created_s);
  proto.mutable_expire_time()->set_seconds(expires_s);
  return proto;
}

absl::Status BuildFileUploadStream::EndedEarly() const {
  return absl::InvalidArgumentError(
      "the upload ended without finish_write; what has arrived is kept: ask GetBuildFile, and "
      "continue there");
}

absl::Status BuildFileUploadStream::WasSilent() const {
  return WithReason(
      absl::DeadlineExceededError(absl::StrCat("no chunk came for ", silence().count(),
                                               " ms; ask GetBuildFile, and continue there")),
      ErrorReason::kUploadSilent);
}

absl::StatusOr<BuildFileUploadStream::After> BuildFileUploadStream::Take(
    const v1::UploadBuildFileRequest& request) {
  if (!file_) return TakeHeader(request);
  if (!request.has_chunk()) {
    return absl::InvalidArgumentError("only chunks may follow the header");
  }
  const v1::BuildFileChunk& chunk = request.chunk();
  if (chunk.data().size() > static_cast<size_t>(limits_.max_chunk_bytes)) {
    return absl::InvalidArgumentError(absl::StrCat("the chunk at ", chunk.write_offset(), " has ",
                                                   chunk.data().size(), " bytes; the limit is ",
                                                   limits_.max_chunk_bytes));
  }
  TF_RETURN_IF_ERROR(files_->Append(*file_, chunk.write_offset(), chunk.data()));
  return chunk.finish_write() ? After::kCheck : After::kMore;
}

absl::StatusOr<BuildFileUploadStream::After> BuildFileUploadStream::TakeHeader(
    const v1::UploadBuildFileRequest& request) {
  if (files_ == nullptr) return NoPlanBuilds();
  if (!request.has_header()) {
    return absl::InvalidArgumentError("the first message must be the header");
  }
  const v1::BuildFileHeader& header = request.header();
  TF_RETURN_IF_ERROR(access_->CheckStorageQuota(scope().principal(), header.total_bytes()));
  TF_ASSIGN_OR_RETURN(BuildFileRecord file, files_->Begin({.sha256 = header.sha256(),
                                                           .owner = scope().principal().name,
                                                           .suffix = header.suffix(),
                                                           .total_bytes = header.total_bytes()}));
  scope().SetResource(BuildFileName(header.sha256()));
  if (!file.is_whole()) {
    file_ = std::move(file);
    return After::kMore;
  }
  TF_ASSIGN_OR_RETURN(const BuildFileRecord whole, files_->Commit(file));
  *response_ = ToProto(whole, files_->ExpiresS(whole));
  return After::kEnd;
}

absl::Status BuildFileUploadStream::Check() {
  TF_ASSIGN_OR_RETURN(const BuildFileRecord arrived, files_->Commit(*file_));
  if (!arrived.is_whole()) {
    return absl::InvalidArgumentError(
        absl::StrCat("finish_write came after ", arrived.committed_bytes, " of ",
                     arrived.total_bytes, " bytes; what has arrived is kept: send the rest"));
  }
  *response_ = ToProto(arrived, files_->ExpiresS(arrived));
  return absl::OkStatus();
}

// What was said to be committed is on the disk before its client asks.
void BuildFileUploadStream::Close() {
  if (file_) files_->Commit(*file_).IgnoreError();
}

}  // namespace tissueform
