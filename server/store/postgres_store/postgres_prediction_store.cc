// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_prediction_store.h"

#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_pages.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

constexpr int64_t kPositionBytes = 12;

absl::StatusOr<PredictionRow> ReadPredictionRow(const PostgresRows& rows, size_t row) {
  return PredictionOf({.id = rows.Text(row, 0),
                       .owner = rows.Text(row, 1),
                       .session = rows.Text(row, 2),
                       .positions_sha256 = rows.Text(row, 3),
                       .record = rows.Text(row, 4),
                       .case_sha256 = rows.Text(row, 5)});
}

absl::StatusOr<PredictionRow> FindPredictionRow(PostgresTransaction& transaction,
                                                const std::string& id) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("SELECT id, owner, session, positions_sha256, record, case_sha256 FROM "
                        "predictions WHERE id = $1",
                        {id}));
  if (rows.empty()) return NoPrediction(id);
  return ReadPredictionRow(rows, 0);
}

absl::StatusOr<PredictionRecord> RecordOfRow(const PostgresRows& rows, size_t row) {
  TF_ASSIGN_OR_RETURN(PredictionRow prediction, ReadPredictionRow(rows, row));
  return std::move(prediction.record);
}

}  // namespace

absl::Status PostgresPredictionStore::Create(const PredictionRecord& record,
                                             const std::string& positions) {
  TF_RETURN_IF_ERROR(CheckPrediction(record, positions));
  const std::string sha256 = Sha256Hex({positions});
  const std::string bytes = Seal(SerializePrediction({record, sha256}));
  const std::vector<absl::string_view> parts = {positions};
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(
        PutBlob(transaction, sha256, static_cast<int64_t>(positions.size()), SourceOfParts(parts)));
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query(
            "INSERT INTO predictions (id, owner, session, case_sha256, "
            "positions_sha256, record) VALUES ($1, $2, $3, $4, $5, $6) ON CONFLICT "
            "(id) DO NOTHING RETURNING key",
            {record.id, record.owner, record.session, record.case_sha256, sha256, bytes}));
    return rows.empty() ? PredictionExists(record.id) : absl::OkStatus();
  });
}

absl::StatusOr<PredictionRecord> PostgresPredictionStore::Get(const std::string& id) {
  return AskPool<PredictionRecord>(
      pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<PredictionRecord> {
        TF_ASSIGN_OR_RETURN(PredictionRow row, FindPredictionRow(transaction, id));
        return std::move(row.record);
      });
}

absl::StatusOr<std::string> PostgresPredictionStore::Positions(const std::string& id) {
  std::string sha256;  // empty: its row is damaged, and nothing is known of its positions
  absl::StatusOr<std::string> positions = AskPool<std::string>(
      pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<std::string> {
        TF_RETURN_IF_ERROR(ReadOneMoment(transaction));
        TF_ASSIGN_OR_RETURN(const PredictionRow row, FindPredictionRow(transaction, id));
        sha256 = row.positions_sha256;
        std::string bytes;
        TF_RETURN_IF_ERROR(ReadBlob(transaction, sha256, row.record.vertex_count * kPositionBytes,
                                    [&bytes](absl::string_view piece) {
                                      bytes.append(piece.data(), piece.size());
                                      return absl::OkStatus();
                                    }));
        return bytes;
      });
  if (!absl::IsDataLoss(positions.status()) || sha256.empty()) return positions;
  return SetPostgresBlobAside(pool_, sha256, positions.status());
}

absl::StatusOr<PredictionStore::Page> PostgresPredictionStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  const std::string also = PostgresNames(request.also);
  return AskPool<Page>(pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query(
            "SELECT id, owner, session, positions_sha256, record, case_sha256 FROM predictions "
            "WHERE id > $1 AND ($2::bigint = 1 OR owner = $3 OR id = ANY (string_to_array($4, "
            "chr(31)))) AND ($5::bigint = 1 OR session = $6) AND "
            "($7::bigint = 1 OR case_sha256 = $8) ORDER BY id LIMIT $9",
            {request.after, int64_t{!request.owner.has_value()}, request.owner.value_or(""), also,
             int64_t{!request.session.has_value()}, request.session.value_or(""),
             int64_t{!request.case_sha256.has_value()}, request.case_sha256.value_or(""),
             RowsOfPage(request.limit)}));
    return ReadPostgresPage<Page>(rows, request.limit, 0, RecordOfRow);
  });
}

absl::Status PostgresPredictionStore::Delete(const std::string& id) {
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_ASSIGN_OR_RETURN(
        const PostgresRows found,
        transaction.Query("SELECT positions_sha256 FROM predictions WHERE id = $1", {id}));
    if (found.empty()) return NoPrediction(id);
    const std::string sha256(found.Text(0, 0));
    TF_RETURN_IF_ERROR(LockBlob(transaction, sha256));
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query(
            "DELETE FROM predictions WHERE id = $1 AND positions_sha256 = $2 RETURNING key",
            {id, sha256}));
    if (rows.empty()) return NoPrediction(id);
    return RemoveUnclaimedBlob(transaction, sha256);
  });
}

}  // namespace tissueform
