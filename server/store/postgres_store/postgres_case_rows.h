// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/case_store.h"
#include "server/store/postgres_store/postgres_connection.h"

// The rows of cases, and the statements that change them.
namespace tissueform {

// Of sha256, owner, record, last_used_s. Errors: DataLoss.
absl::StatusOr<CaseRecord> ReadCaseColumns(const PostgresRows& rows, size_t row);

// Errors: NotFound, DataLoss.
absl::StatusOr<CaseRecord> FindCaseRow(PostgresTransaction& transaction, const CaseKey& key);

absl::Status TouchCaseRow(PostgresTransaction& transaction, const CaseKey& key, int64_t now_s);

// Errors: ResourceExhausted, where `most` are kept.
absl::Status CheckCaseRoom(PostgresTransaction& transaction, int most);

// The row as it is then: of one that was there only last_used_s rises. Whoever adds one counts
// alone. REQUIRES: its blob is locked (PutBlob). Errors: ResourceExhausted.
absl::StatusOr<CaseRecord> KeepCaseRow(PostgresTransaction& transaction, const CaseRecord& record,
                                       int most);

// With its blob, unless another row claims that. Errors: NotFound.
absl::Status DeleteCaseRow(PostgresTransaction& transaction, const CaseKey& key);

}  // namespace tissueform
