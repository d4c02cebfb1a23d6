// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_case_rows.h"

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

// Whoever adds a case counts those that are there: one after the other.
constexpr char kCountAlone[] = "SELECT pg_advisory_xact_lock(6073473466130133613)";

}  // namespace

absl::StatusOr<CaseRecord> ReadCaseColumns(const PostgresRows& rows, size_t row) {
  return CaseOf({.sha256 = rows.Text(row, 0),
                 .owner = rows.Text(row, 1),
                 .record = rows.Text(row, 2),
                 .last_used_s = rows.Integer(row, 3)});
}

absl::StatusOr<CaseRecord> FindCaseRow(PostgresTransaction& transaction, const CaseKey& key) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("SELECT sha256, owner, record, last_used_s FROM cases WHERE sha256 = $1 "
                        "AND owner = $2",
                        {key.sha256, key.owner}));
  if (rows.empty()) return NoCase(key.sha256);
  return ReadCaseColumns(rows, 0);
}

absl::Status TouchCaseRow(PostgresTransaction& transaction, const CaseKey& key, int64_t now_s) {
  return transaction.Run(
      "UPDATE cases SET last_used_s = $1 WHERE last_used_s < $1 AND sha256 = $2 AND owner = $3",
      {now_s, key.sha256, key.owner});
}

absl::Status CheckCaseRoom(PostgresTransaction& transaction, int most) {
  TF_ASSIGN_OR_RETURN(const PostgresRows rows, transaction.Query("SELECT count(*) FROM cases", {}));
  return rows.Integer(0, 0) < most ? absl::OkStatus() : TooManyCases(most);
}

absl::StatusOr<CaseRecord> KeepCaseRow(PostgresTransaction& transaction, const CaseRecord& record,
                                       int most) {
  TF_RETURN_IF_ERROR(transaction.Execute(kCountAlone));
  const absl::StatusOr<CaseRecord> found = FindCaseRow(transaction, record.key());
  if (found.ok()) {
    TF_RETURN_IF_ERROR(TouchCaseRow(transaction, record.key(), record.last_used_s));
    return FindCaseRow(transaction, record.key());
  }
  if (!absl::IsNotFound(found.status()) && !absl::IsDataLoss(found.status())) return found;
  TF_RETURN_IF_ERROR(CheckCaseRoom(transaction, most));
  const std::string bytes = Seal(SerializeCaseRecord(record));
  // In place of a row that cannot be read.
  TF_RETURN_IF_ERROR(transaction.Run(
      "INSERT INTO cases (sha256, owner, record, last_used_s) VALUES ($1, $2, $3, $4) ON CONFLICT "
      "(sha256, owner) DO UPDATE SET record = excluded.record, last_used_s = excluded.last_used_s",
      {record.sha256, record.owner, bytes, record.last_used_s}));
  return record;
}

absl::Status DeleteCaseRow(PostgresTransaction& transaction, const CaseKey& key) {
  TF_RETURN_IF_ERROR(LockBlob(transaction, key.sha256));
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("DELETE FROM cases WHERE sha256 = $1 AND owner = $2 RETURNING key",
                        {key.sha256, key.owner}));
  if (rows.empty()) return NoCase(key.sha256);
  return RemoveUnclaimedBlob(transaction, key.sha256);
}

}  // namespace tissueform
