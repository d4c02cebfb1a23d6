// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_index.h"

#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "server/store/session_record.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

// Bounds memory: a session's record may have megabytes.
constexpr int64_t kRowsAtOnce = 100;

// `select` returns key and record of $2 rows with keys greater than $1, in their order. `update`
// gets what `index` finds in the record, then the key.
template <typename Index>
absl::Status FillTable(SqlTransaction& transaction, const char* select, const char* update,
                       Index index) {
  int64_t after = 0;
  for (;;) {
    TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query(select, {after, kRowsAtOnce}));
    if (rows.empty()) return absl::OkStatus();
    for (size_t row = 0; row < rows.size(); ++row) {
      after = rows.Integer(row, 0);
      const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(row, 1));
      if (!bytes.ok()) continue;
      TF_RETURN_IF_ERROR(index(*bytes, [&](std::vector<SqlValue> values) {
        values.emplace_back(after);
        return transaction.Run(update, values);
      }));
    }
  }
}

// For FillTable: the index of a row of rights.
template <typename Row>
auto RightsIndex() {
  return [](absl::string_view bytes, const auto& write) -> absl::Status {
    Row row;
    if (!ParseRow(bytes, &row).ok()) return absl::OkStatus();
    const auto index = IndexOf(row);
    return write({index.begin(), index.end()});
  };
}

absl::Status FillSessions(SqlTransaction& transaction) {
  return FillTable(transaction,
                   "SELECT key, record FROM sessions WHERE key > $1 ORDER BY key LIMIT $2",
                   "UPDATE sessions SET mesh_sha256 = $1, project = $2 WHERE key = $3",
                   [](absl::string_view bytes, const auto& write) -> absl::Status {
                     const absl::StatusOr<SessionRecord> record = ParseRecord(bytes);
                     if (!record.ok()) return absl::OkStatus();
                     return write({record->mesh_sha256, record->project});
                   });
}

absl::Status FillPredictions(SqlTransaction& transaction) {
  return FillTable(transaction,
                   "SELECT key, record FROM predictions WHERE key > $1 ORDER BY key LIMIT $2",
                   "UPDATE predictions SET mesh_sha256 = $1, bytes = $2 WHERE key = $3",
                   [](absl::string_view bytes, const auto& write) -> absl::Status {
                     const absl::StatusOr<PredictionRow> row = ParsePrediction(bytes);
                     if (!row.ok()) return absl::OkStatus();
                     return write({row->record.mesh_sha256, BytesOf(row->record)});
                   });
}

absl::Status FillCases(SqlTransaction& transaction) {
  return FillTable(transaction,
                   "SELECT key, record FROM cases WHERE key > $1 ORDER BY key LIMIT $2",
                   "UPDATE cases SET project = $1, bytes = $2 WHERE key = $3",
                   [](absl::string_view bytes, const auto& write) -> absl::Status {
                     const absl::StatusOr<CaseRecord> record = ParseCaseRecord(bytes);
                     if (!record.ok()) return absl::OkStatus();
                     return write({record->project, record->total_bytes});
                   });
}

}  // namespace

std::array<SqlValue, 3> IndexOf(const ShareRow& row) {
  return {row.owner, row.resource, row.principal};
}
std::array<SqlValue, 3> IndexOf(const FollowLinkRow& row) {
  return {row.session, row.maker, row.expires_s};
}
std::array<SqlValue, 3> IndexOf(const MeshRight& row) {
  return {row.principal, row.sha256, row.bytes};
}

int64_t BytesOf(const PredictionRecord& record) {
  return kVertexBytes * record.vertex_count + static_cast<int64_t>(record.metadata.size());
}

absl::Status FillIndex(SqlTransaction& transaction) {
  TF_RETURN_IF_ERROR(FillSessions(transaction));
  TF_RETURN_IF_ERROR(FillPredictions(transaction));
  TF_RETURN_IF_ERROR(FillCases(transaction));
  TF_RETURN_IF_ERROR(
      FillTable(transaction, "SELECT key, record FROM shares WHERE key > $1 ORDER BY key LIMIT $2",
                "UPDATE shares SET owner = $1, resource = $2, principal = $3 WHERE key = $4",
                RightsIndex<ShareRow>()));
  TF_RETURN_IF_ERROR(FillTable(
      transaction, "SELECT key, record FROM follow_links WHERE key > $1 ORDER BY key LIMIT $2",
      "UPDATE follow_links SET session = $1, maker = $2, expires_s = $3 WHERE key = $4",
      RightsIndex<FollowLinkRow>()));
  return FillTable(transaction,
                   "SELECT key, record FROM mesh_rights WHERE key > $1 ORDER BY key LIMIT $2",
                   "UPDATE mesh_rights SET principal = $1, sha256 = $2, bytes = $3 WHERE key = $4",
                   RightsIndex<MeshRight>());
}

}  // namespace tissueform
