// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_blobs.h"

#include "core/base/status_macros.h"

namespace tissueform {

absl::Status DeleteClaims(SqlTransaction& transaction, const std::string& sha256) {
  for (const char* statement :
       {"UPDATE sessions SET mesh = NULL WHERE mesh = $1", "DELETE FROM meshes WHERE sha256 = $1",
        "DELETE FROM cases WHERE sha256 = $1",
        "DELETE FROM predictions WHERE positions_sha256 = $1"}) {
    TF_RETURN_IF_ERROR(transaction.Run(statement, {sha256}));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
