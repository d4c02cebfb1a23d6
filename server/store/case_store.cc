// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/case_store.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {

absl::Status CheckCaseRecord(const CaseRecord& record) {
  if (!IsSha256Hex(record.sha256)) {
    return absl::InvalidArgumentError(
        "a case is named by its file's SHA-256, 64 lower-case hexadecimal digits");
  }
  if (record.total_bytes > 0) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "case ", record.sha256, " has ", record.total_bytes, " bytes; it must have at least one"));
}

absl::Status CaseWriter::Write(int64_t offset, absl::string_view bytes) {
  if (offset != written_bytes_) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrCat("case ", record_.sha256, ": ", written_bytes_,
                                       " bytes have arrived; continue there, not at ", offset)),
                      ErrorReason::kChunkOutOfPlace,
                      {{"committed_bytes", absl::StrCat(written_bytes_)}});
  }
  if (bytes.size() > static_cast<size_t>(record_.total_bytes - written_bytes_)) {
    return absl::InvalidArgumentError(
        absl::StrCat("case ", record_.sha256, " ends at ", record_.total_bytes,
                     " bytes by its header; the chunk at ", offset, " reaches further"));
  }
  TF_RETURN_IF_ERROR(Append(bytes));
  digest_.Add(bytes);
  written_bytes_ += static_cast<int64_t>(bytes.size());
  return absl::OkStatus();
}

absl::StatusOr<CaseRecord> CaseWriter::Finish() {
  if (written_bytes_ != record_.total_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("case ", record_.sha256, " has ", written_bytes_,
                                                   " bytes, its header says ", record_.total_bytes,
                                                   "; send all of them"));
  }
  if (digest_.Hex() != record_.sha256) {
    return WithReason(absl::DataLossError(absl::StrCat(
                          "the bytes of case ", record_.sha256,
                          " have another SHA-256: they were damaged in transit; send them again")),
                      ErrorReason::kCaseDamagedOnItsWay);
  }
  return Keep();
}

absl::StatusOr<std::string> CaseReader::Read(int64_t offset, int64_t size) {
  const int64_t wanted = std::min(size, total_bytes_ - offset);
  TF_ASSIGN_OR_RETURN(std::string bytes, ReadAt(offset, wanted));
  const auto got = static_cast<int64_t>(bytes.size());
  if (got != wanted) {
    return SetAside(Damaged(absl::StrCat("case ", sha256_), "its file is too short"));
  }
  if (offset != digested_bytes_) return bytes;
  digest_.Add(bytes);
  digested_bytes_ += got;
  if (got > 0 && digested_bytes_ == total_bytes_ && digest_.Hex() != sha256_) {
    return SetAside(Damaged(absl::StrCat("case ", sha256_), "its SHA-256 is wrong"));
  }
  return bytes;
}

}  // namespace tissueform
