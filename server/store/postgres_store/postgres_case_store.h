// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/store/case_store.h"
#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// Cases in a PostgreSQL database. One that comes, and one that is read, is a file without a name in
// this machine's temporary folder meanwhile: no transaction stays open for a slow client. `pool`
// must outlive it.
class PostgresCaseStore final : public CaseStore {
 public:
  explicit PostgresCaseStore(PostgresPool* pool) : pool_(pool) {}

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
  PostgresPool* const pool_;
};

}  // namespace tissueform
