// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/case_store.h"
#include "server/store/sql_blobs.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Rows that claim blobs: the blob is the case's file.
class SqlCaseStore : public CaseStore {
 public:
  // Both must outlive it.
  SqlCaseStore(SqlDatabase* database, SqlBlobs* blobs) : database_(database), blobs_(blobs) {}

  absl::StatusOr<std::unique_ptr<CaseWriter>> Begin(CaseRecord record, int most) override;
  absl::StatusOr<CaseRecord> Find(const CaseKey& key) override;
  absl::StatusOr<std::unique_ptr<CaseReader>> Open(const CaseKey& key, int64_t now_s) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const CaseKey& key) override;
  absl::Status Touch(const CaseKey& key, int64_t now_s) override;
  absl::StatusOr<std::vector<CaseKey>> RemoveUnused(int64_t before_s,
                                                    const std::set<std::string>& spared,
                                                    int most) override;

 private:
  // Deletes a row that was last used before then.
  absl::Status DeleteUnused(const CaseKey& key, int64_t before_s);

  SqlDatabase* const database_;
  SqlBlobs* const blobs_;
};

BlobClaim ClaimOf(const CaseRecord& record);

}  // namespace tissueform
