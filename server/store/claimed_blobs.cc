// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/claimed_blobs.h"

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/fault_points.h"
#include "server/store/store_errors.h"
#include "server/store/store_rows.h"

namespace tissueform {

absl::Status Claim(CommitThread* thread, BlobStore* blobs, const std::string& sha256,
                   absl::StatusOr<BlobStore::Pin> pin,
                   const std::function<absl::Status(Database&)>& claim) {
  absl::Status status;
  {
    TF_ASSIGN_OR_RETURN(const BlobStore::Pin held, std::move(pin));
    TF_FAULT_POINT("claim.blob_kept");
    status = thread->Run({.work = claim});
  }
  if (!status.ok()) {
    const auto nothing = [](Database&) { return absl::OkStatus(); };
    thread
        ->Run({.work = nothing,
               .after =
                   [&](Database& database) { return RemoveUnclaimed(database, *blobs, sha256); }})
        .IgnoreError();
  }
  return status;
}

absl::Status SetBlobAside(CommitThread* thread, BlobStore* blobs, const std::string& sha256,
                          const absl::Status& damage) {
  const absl::Status status =
      thread->Run({.work = [&](Database& database) { return DeleteClaims(database, sha256); },
                   .after = [&](Database&) { return blobs->SetAside(sha256).status(); }});
  if (!status.ok()) return status;
  return damage;
}

absl::Status CheckBlobSize(const BlobStore& blobs, const std::string& sha256, int64_t wanted) {
  TF_ASSIGN_OR_RETURN(const int64_t bytes, blobs.Size(sha256));
  if (bytes == wanted) return absl::OkStatus();
  return Damaged(absl::StrCat("the file of ", sha256),
                 absl::StrCat("it has ", bytes, " bytes, not ", wanted));
}

}  // namespace tissueform
