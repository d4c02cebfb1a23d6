// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/database.h"
#include "server/store/blob_store.h"
#include "server/store/durable_store.h"

namespace tissueform {

// The database of a folder, with tables of this version and without a damaged page.
struct OpenedDatabase {
  std::unique_ptr<Database> database;
  // Rows may be missing, because it is new or was repaired: a blob that no row claims is then not a
  // leftover, and is kept.
  bool rows_may_be_missing = false;
};

// Opens or makes it. One with damaged pages is copied to the folder `damaged`, and what rows can be
// read take its place; that goes to the list.
//
// Errors: FailedPrecondition (not our database, or one by a newer server), DataLoss (cannot be
// repaired: put a backup back), or those of Database.
absl::StatusOr<OpenedDatabase> OpenCheckedDatabase(const DataFolder& folder, int64_t now_s,
                                                   std::vector<DamagedItem>* damaged);

// Reads all rows and the blobs that they claim, of which the bytes of `max_checked_bytes` and the
// sizes of the rest. What is damaged is moved to the folder `damaged` with its row, and goes to the
// list. Blobs that no row claims are removed, or moved there too.
absl::Status CheckRowsAndBlobs(OpenedDatabase& opened, BlobStore& blobs, const DataFolder& folder,
                               int64_t max_checked_bytes, std::vector<DamagedItem>* damaged);

}  // namespace tissueform
