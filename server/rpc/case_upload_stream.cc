// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/case_upload_stream.h"

#include <string>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/case_conversion.h"
#include "server/access/access.h"
#include "server/store/session_store.h"

namespace tissueform {

v1::Case ToProto(const CaseRecord& record) {
  v1::Case proto;
  proto.set_name(CaseName(record.sha256));
  proto.set_title(record.title);
  proto.set_total_bytes(record.total_bytes);
  proto.mutable_create_time()->set_seconds(record.created_s);
  proto.set_project(record.project);
  return proto;
}

absl::Status CaseUploadStream::EndedEarly() const {
  return absl::InvalidArgumentError(
      "the upload ended without finish_write and was discarded; send the "
      "case again");
}

absl::Status CaseUploadStream::WasSilent() const {
  return WithReason(
      absl::DeadlineExceededError(absl::StrCat("no chunk came for ", silence().count(),
                                               " ms; send the case again from its beginning")),
      ErrorReason::kUploadSilent);
}

absl::StatusOr<CaseUploadStream::After> CaseUploadStream::Take(
    const v1::UploadCaseRequest& request) {
  if (writer_ == nullptr) return TakeHeader(request);
  if (!request.has_chunk()) {
    return absl::InvalidArgumentError("only chunks may follow the header");
  }
  const v1::CaseChunk& chunk = request.chunk();
  if (chunk.data().size() > static_cast<size_t>(limits_.max_chunk_bytes)) {
    return absl::InvalidArgumentError(absl::StrCat("the chunk at ", chunk.write_offset(), " has ",
                                                   chunk.data().size(), " bytes; the limit is ",
                                                   limits_.max_chunk_bytes));
  }
  TF_RETURN_IF_ERROR(writer_->Write(chunk.write_offset(), chunk.data()));
  return chunk.finish_write() ? After::kCheck : After::kMore;
}

absl::StatusOr<CaseUploadStream::After> CaseUploadStream::TakeHeader(
    const v1::UploadCaseRequest& request) {
  if (!request.has_header()) {
    return absl::InvalidArgumentError("the first message must be the header");
  }
  const v1::CaseHeader& header = request.header();
  TF_RETURN_IF_ERROR(CheckHeader(header));
  const int64_t now_s = SystemUnixSeconds();
  CaseRecord record{.sha256 = header.sha256(),
                    .owner = scope().principal().name,
                    .project = header.project(),
                    .title = header.title(),
                    .total_bytes = header.total_bytes(),
                    .created_s = now_s,
                    .last_used_s = now_s};
  TF_RETURN_IF_ERROR(CheckCaseRecord(record));
  TF_RETURN_IF_ERROR(Access::CheckProjectAccess(scope().principal(), header.project()));
  scope().SetResource(CaseName(record.sha256));
  const auto known = store_->Find(record.key());
  // A store that was waited for in vain is not waited for once more after the bytes.
  if (absl::IsUnavailable(known.status())) return known.status();
  if (known.ok()) {
    TF_RETURN_IF_ERROR(store_->Touch(record.key(), now_s));
    *response_->mutable_case_() = ToProto(*known);
    response_->set_already_existed(true);
    return After::kEnd;
  }
  TF_RETURN_IF_ERROR(access_->CheckStorageQuota(scope().principal(), record.total_bytes));
  TF_RETURN_IF_ERROR(TakePlace());
  TF_ASSIGN_OR_RETURN(writer_, store_->Begin(std::move(record), limits_.max_cases));
  return After::kMore;
}

absl::Status CaseUploadStream::CheckHeader(const v1::CaseHeader& header) const {
  if (header.total_bytes() > limits_.max_case_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("the case has ", header.total_bytes(),
                                                     " bytes; the server takes ",
                                                     limits_.max_case_bytes, " (max_case_bytes)"));
  }
  return CheckTitle(header.title(), limits_.max_title_bytes);
}

absl::Status CaseUploadStream::TakePlace() {
  has_place_ = true;
  if (under_way_->fetch_add(1) < limits_.max_case_uploads) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat(
      limits_.max_case_uploads,
      " cases are being uploaded, which is the limit (max_case_uploads); try again in a "
      "moment"));
}

absl::Status CaseUploadStream::Check() {
  TF_ASSIGN_OR_RETURN(const CaseRecord kept, writer_->Finish());
  *response_->mutable_case_() = ToProto(kept);
  return absl::OkStatus();
}

void CaseUploadStream::Close() {
  writer_.reset();
  if (has_place_) --*under_way_;
}

}  // namespace tissueform
