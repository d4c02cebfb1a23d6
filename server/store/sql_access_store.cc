// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_access_store.h"

#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/access_rows.h"
#include "server/store/store_index.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

struct Statements {
  const char* select;
  const char* find;
  const char* erase;
  const char* put;
};
// Parameters of `put` are the key, the record, and the columns of IndexOf.
#define TF_ACCESS_STATEMENTS(table, columns, parameters)                                         \
  {                                                                                              \
    "SELECT name, record FROM " table " ORDER BY name",                                          \
        "SELECT record FROM " table " WHERE name = $1", "DELETE FROM " table " WHERE name = $1", \
        "INSERT INTO " table " (name, record, " columns ") VALUES ($1, $2, " parameters          \
        ") ON CONFLICT (name) DO UPDATE SET record = excluded.record"                            \
  }
constexpr Statements kShares =
    TF_ACCESS_STATEMENTS("shares", "owner, resource, principal", "$3, $4, $5");
// A link never changes, and neither do the bytes of a mesh.
constexpr Statements kLinks =
    TF_ACCESS_STATEMENTS("follow_links", "session, maker, expires_s", "$3, $4, $5");
constexpr Statements kMeshRights =
    TF_ACCESS_STATEMENTS("mesh_rights", "principal, sha256, bytes", "$3, $4, $5");
#undef TF_ACCESS_STATEMENTS

template <typename Row>
absl::Status LoadRows(SqlTransaction& transaction, const Statements& statements,
                      std::vector<Row>* loaded) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query(statements.select, {}));
  for (size_t i = 0; i < rows.size(); ++i) {
    Row row;
    const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(i, 1));
    if (!bytes.ok() || !ParseRow(*bytes, &row).ok() || KeyOf(row) != rows.Text(i, 0)) continue;
    loaded->push_back(std::move(row));
  }
  return absl::OkStatus();
}

template <typename Row>
absl::Status ChangeRows(SqlTransaction& transaction, const Statements& statements,
                        const std::vector<Row>& erase, const std::vector<Row>& put) {
  for (const Row& row : erase) {
    TF_RETURN_IF_ERROR(transaction.Run(statements.erase, {KeyOf(row)}));
  }
  for (const Row& row : put) {
    const std::string key = KeyOf(row);
    const std::string record = Seal(SerializeRow(row));
    std::vector<SqlValue> values = {key, SqlBytes{record}};
    for (const SqlValue& value : IndexOf(row)) values.push_back(value);
    TF_RETURN_IF_ERROR(transaction.Run(statements.put, values));
  }
  return absl::OkStatus();
}

template <typename Row>
absl::StatusOr<Row> FindRow(SqlDatabase* database, const Statements& statements,
                            const Row& wanted) {
  const std::string key = KeyOf(wanted);
  return ReadSql<Row>(database, [&](SqlTransaction& transaction) -> absl::StatusOr<Row> {
    TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query(statements.find, {key}));
    if (rows.empty()) return absl::NotFoundError("no such access right");
    TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(rows.Text(0, 0)));
    Row row;
    TF_RETURN_IF_ERROR(ParseRow(bytes, &row));
    if (KeyOf(row) != key) return absl::DataLossError("an access right is another's");
    return row;
  });
}

}  // namespace

absl::StatusOr<FollowLinkRow> SqlAccessStore::FindLink(const std::string& digest) {
  return FindRow<FollowLinkRow>(database_, kLinks, {.digest = digest});
}

absl::StatusOr<MeshRight> SqlAccessStore::FindMeshRight(const std::string& principal,
                                                        const std::string& sha256) {
  return FindRow<MeshRight>(database_, kMeshRights, {.principal = principal, .sha256 = sha256});
}

absl::StatusOr<AccessRows> SqlAccessStore::Load() {
  return ReadSql<AccessRows>(
      database_, [](SqlTransaction& transaction) -> absl::StatusOr<AccessRows> {
        AccessRows rows;
        TF_RETURN_IF_ERROR(transaction.ReadOneMoment());
        TF_RETURN_IF_ERROR(LoadRows(transaction, kShares, &rows.shares));
        TF_RETURN_IF_ERROR(LoadRows(transaction, kLinks, &rows.links));
        TF_RETURN_IF_ERROR(LoadRows(transaction, kMeshRights, &rows.mesh_rights));
        return rows;
      });
}

void SqlAccessStore::Change(AccessRows erase, AccessRows put,
                            std::function<void(absl::Status)> done) {
  const bool erases = !erase.shares.empty() || !erase.links.empty() || !erase.mesh_rights.empty();
  database_->Submit(
      "",
      {.work = [erase = std::move(erase),
                put = std::move(put)](SqlTransaction& transaction) -> absl::Status {
         TF_RETURN_IF_ERROR(ChangeRows(transaction, kShares, erase.shares, put.shares));
         TF_RETURN_IF_ERROR(ChangeRows(transaction, kLinks, erase.links, put.links));
         return ChangeRows(transaction, kMeshRights, erase.mesh_rights, put.mesh_rights);
       },
       .erases = erases},
      std::move(done));
}

}  // namespace tissueform
