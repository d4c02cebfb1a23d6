// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "server/store/postgres_store/postgres_stores.h"
#include "server/store/sql_stores.h"

namespace tissueform {

struct MigrationSummary {
  int64_t sessions = 0;
  int64_t meshes = 0;
  int64_t predictions = 0;
  int64_t cases = 0;
  int64_t access_rows = 0;
  int64_t exports = 0;
};

// Copies all that one server has kept (a DurableStore, which has checked it) into the empty store
// of several, table by table: with ids, etags, epochs and times, so that clients go on with what
// they have. Every blob is read with its digest. Meshes that have not arrived in full stay behind:
// their clients upload them again. `from` is not changed; no other process may use it during the
// copy.
//
// Errors: FailedPrecondition (there is something in `to`), DataLoss (a blob of `from` is damaged),
// or those of the stores. After an error `to` holds a part: empty its database, and start again.
absl::StatusOr<MigrationSummary> MigrateStore(SqlStores* from, PostgresStores* to);

}  // namespace tissueform
