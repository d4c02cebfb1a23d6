// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/access_store.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Rows by their keys. A change is kept in the order of the calls.
class SqlAccessStore : public AccessStore {
 public:
  // `database` must outlive it.
  explicit SqlAccessStore(SqlDatabase* database) : database_(database) {}

  absl::StatusOr<AccessRows> Load() override;
  void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) override;

  // One row. Block. Errors: NotFound; DataLoss: it is damaged.
  absl::StatusOr<FollowLinkRow> FindLink(const std::string& digest);
  absl::StatusOr<MeshRight> FindMeshRight(const std::string& principal, const std::string& sha256);

 private:
  SqlDatabase* const database_;
};

}  // namespace tissueform
