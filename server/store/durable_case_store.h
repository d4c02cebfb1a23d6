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

#include "server/store/blob_store.h"
#include "server/store/case_store.h"
#include "server/store/commit_thread.h"

namespace tissueform {

// Rows of a database that claim blobs (claimed_blobs.h): the blob is the case's file.
class DurableCaseStore final : public CaseStore {
 public:
  // Both must outlive it.
  DurableCaseStore(CommitThread* thread, BlobStore* blobs) : thread_(thread), blobs_(blobs) {}

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
  CommitThread* const thread_;
  BlobStore* const blobs_;
};

}  // namespace tissueform
