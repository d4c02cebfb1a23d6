// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_prediction_store.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/access_queries.h"
#include "server/store/store_errors.h"
#include "server/store/store_index.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

absl::StatusOr<PredictionRow> FindRow(SqlTransaction& transaction, const std::string& id) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query(TF_SELECT_PREDICTIONS "WHERE id = $1", {id}));
  if (rows.empty()) return NoPrediction(id);
  return ReadPrediction(rows, 0);
}

absl::StatusOr<PredictionRecord> ReadRecord(const SqlRows& rows, size_t row) {
  TF_ASSIGN_OR_RETURN(PredictionRow prediction, ReadPrediction(rows, row));
  return std::move(prediction.record);
}

}  // namespace

BlobClaim ClaimOf(const PredictionRow& row) {
  return {.sha256 = row.positions_sha256,
          .bytes = row.record.vertex_count * kVertexBytes,
          .what = absl::StrCat("prediction \"", row.record.id, "\"")};
}

absl::Status SqlPredictionStore::Create(const PredictionRecord& record,
                                        const std::string& positions) {
  TF_RETURN_IF_ERROR(CheckPrediction(record, positions));
  const std::string sha256 = Sha256Hex({positions});
  const std::string bytes = Seal(SerializePrediction({record, sha256}));
  return blobs_->Put(sha256, {positions}, [&](SqlTransaction& transaction) -> absl::Status {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query("INSERT INTO predictions (id, owner, session, case_sha256, "
                          "positions_sha256, record, mesh_sha256, bytes) VALUES ($1, $2, $3, $4, "
                          "$5, $6, $7, $8) ON CONFLICT (id) DO NOTHING RETURNING key",
                          {record.id, record.owner, record.session, record.case_sha256, sha256,
                           SqlBytes{bytes}, record.mesh_sha256, BytesOf(record)}));
    return rows.empty() ? PredictionExists(record.id) : absl::OkStatus();
  });
}

absl::StatusOr<PredictionRecord> SqlPredictionStore::Get(const std::string& id) {
  TF_ASSIGN_OR_RETURN(PredictionRow row,
                      ReadSql<PredictionRow>(database_, [&](SqlTransaction& transaction) {
                        return FindRow(transaction, id);
                      }));
  return std::move(row.record);
}

absl::StatusOr<std::string> SqlPredictionStore::Positions(const std::string& id) {
  std::string positions;
  const auto find = [&](SqlTransaction& transaction) -> absl::StatusOr<BlobClaim> {
    positions.clear();
    TF_ASSIGN_OR_RETURN(const PredictionRow row, FindRow(transaction, id));
    return ClaimOf(row);
  };
  TF_RETURN_IF_ERROR(blobs_->Read(find, [&positions](absl::string_view piece) {
    positions.append(piece.data(), piece.size());
    return absl::OkStatus();
  }));
  return positions;
}

absl::StatusOr<PredictionStore::Page> SqlPredictionStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  const std::string also = SqlNames(request.also);
  return ReadSql<Page>(database_, [&](SqlTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query(TF_SELECT_PREDICTIONS
                          "WHERE id > $1 AND ($2::bigint = 1 OR owner = $3 OR id = ANY "
                          "(string_to_array($4, chr(31)))) AND ($5::bigint = 1 OR session = $6) "
                          "AND ($7::bigint = 1 OR case_sha256 = $8) ORDER BY id LIMIT $9",
                          {request.after, int64_t{!request.owner.has_value()},
                           request.owner.value_or(""), also, int64_t{!request.session.has_value()},
                           request.session.value_or(""), int64_t{!request.case_sha256.has_value()},
                           request.case_sha256.value_or(""), RowsOfPage(request.limit)}));
    return ReadPage<Page>(rows, request.limit, 0, ReadRecord);
  });
}

absl::Status SqlPredictionStore::Delete(const std::string& id) {
  using Names = std::vector<std::string>;
  return blobs_->Remove([&](SqlTransaction& transaction) -> absl::StatusOr<Names> {
    TF_ASSIGN_OR_RETURN(
        const SqlRows found,
        transaction.Query("SELECT positions_sha256 FROM predictions WHERE id = $1", {id}));
    if (found.empty()) return NoPrediction(id);
    const std::string sha256(found.Text(0, 0));
    TF_RETURN_IF_ERROR(blobs_->Lock(transaction, sha256));
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query(
            "DELETE FROM predictions WHERE id = $1 AND positions_sha256 = $2 RETURNING owner",
            {id, sha256}));
    if (rows.empty()) return NoPrediction(id);
    TF_RETURN_IF_ERROR(EraseAccessToPrediction(transaction, std::string(rows.Text(0, 0)), id));
    return Names{sha256};
  });
}

}  // namespace tissueform
