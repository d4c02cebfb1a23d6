// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>

#include "absl/status/status.h"

#include "server/store/access_rows.h"
#include "server/store/prediction_store.h"
#include "server/store/sql_database.h"

// Columns that repeat parts of a record, so that access_queries.h finds rows by them.
namespace tissueform {

// Of a row of rights, in the order of store_schema.h. Views into the row.
std::array<SqlValue, 3> IndexOf(const ShareRow& row);       // owner, resource, principal
std::array<SqlValue, 3> IndexOf(const FollowLinkRow& row);  // session, maker, expires_s
std::array<SqlValue, 3> IndexOf(const MeshRight& row);      // principal, sha256, bytes

// What a prediction counts for in its owner's quota.
int64_t BytesOf(const PredictionRecord& record);

// Fills the columns of all rows whose record can be read, for stores of a version without them.
// Others keep their defaults: no name finds them. Errors: those of SqlTransaction.
absl::Status FillIndex(SqlTransaction& transaction);

}  // namespace tissueform
