// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_access_store.h"

#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/access_store/access_rows.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

struct Statements {
  const char* select;
  const char* erase;
  const char* put;
};
#define TF_ACCESS_STATEMENTS(table)                                                              \
  {                                                                                              \
    "SELECT name, record FROM " table " ORDER BY name", "DELETE FROM " table " WHERE name = $1", \
        "INSERT INTO " table                                                                     \
        " (name, record) VALUES ($1, $2) ON CONFLICT (name) "                                    \
        "DO UPDATE SET record = excluded.record"                                                 \
  }
constexpr Statements kShareStatements = TF_ACCESS_STATEMENTS("shares");
constexpr Statements kLinkStatements = TF_ACCESS_STATEMENTS("follow_links");
constexpr Statements kRightStatements = TF_ACCESS_STATEMENTS("mesh_rights");

template <typename Row>
absl::Status LoadRows(PostgresTransaction& transaction, const Statements& statements,
                      std::vector<Row>* loaded) {
  TF_ASSIGN_OR_RETURN(const PostgresRows rows, transaction.Query(statements.select, {}));
  for (size_t i = 0; i < rows.size(); ++i) {
    Row row;
    const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(i, 1));
    if (!bytes.ok() || !ParseRow(*bytes, &row).ok() || KeyOf(row) != rows.Text(i, 0)) continue;
    loaded->push_back(std::move(row));
  }
  return absl::OkStatus();
}

template <typename Row>
absl::Status ChangeRows(PostgresTransaction& transaction, const Statements& statements,
                        const std::vector<Row>& erase, const std::vector<Row>& put) {
  for (const Row& row : erase) {
    TF_RETURN_IF_ERROR(transaction.Run(statements.erase, {KeyOf(row)}));
  }
  for (const Row& row : put) {
    TF_RETURN_IF_ERROR(transaction.Run(statements.put, {KeyOf(row), Seal(SerializeRow(row))}));
  }
  return absl::OkStatus();
}

template <typename Row>
absl::StatusOr<Row> FindRow(PostgresPool* pool, const char* select, const Row& wanted) {
  const std::string key = KeyOf(wanted);
  return AskPool<Row>(pool, [&](PostgresTransaction& transaction) -> absl::StatusOr<Row> {
    TF_ASSIGN_OR_RETURN(const PostgresRows rows, transaction.Query(select, {key}));
    if (rows.empty()) return absl::NotFoundError("no such access right");
    TF_ASSIGN_OR_RETURN(const absl::string_view bytes, Unseal(rows.Text(0, 0)));
    Row row;
    TF_RETURN_IF_ERROR(ParseRow(bytes, &row));
    if (KeyOf(row) != key) return absl::DataLossError("an access right is another's");
    return row;
  });
}

}  // namespace

absl::StatusOr<FollowLinkRow> PostgresAccessStore::FindLink(const std::string& digest) {
  return FindRow<FollowLinkRow>(pool_, "SELECT record FROM follow_links WHERE name = $1",
                                {.digest = digest});
}

absl::StatusOr<MeshRight> PostgresAccessStore::FindMeshRight(const std::string& principal,
                                                             const std::string& sha256) {
  return FindRow<MeshRight>(pool_, "SELECT record FROM mesh_rights WHERE name = $1",
                            {.principal = principal, .sha256 = sha256});
}

absl::StatusOr<AccessRows> PostgresAccessStore::Load() {
  return AskPool<AccessRows>(
      pool_, [](PostgresTransaction& transaction) -> absl::StatusOr<AccessRows> {
        AccessRows rows;
        TF_RETURN_IF_ERROR(ReadOneMoment(transaction));
        TF_RETURN_IF_ERROR(LoadRows(transaction, kShareStatements, &rows.shares));
        TF_RETURN_IF_ERROR(LoadRows(transaction, kLinkStatements, &rows.links));
        TF_RETURN_IF_ERROR(LoadRows(transaction, kRightStatements, &rows.mesh_rights));
        return rows;
      });
}

void PostgresAccessStore::Change(AccessRows erase, AccessRows put,
                                 std::function<void(absl::Status)> done) {
  const auto deadline = PostgresPool::Clock::now() + pool_->options().patience;
  jobs_.Submit("", [this, deadline, erase = std::move(erase), put = std::move(put),
                    done = std::move(done)] {
    done(pool_->Run(
        [&](PostgresTransaction& transaction) -> absl::Status {
          TF_RETURN_IF_ERROR(ChangeRows(transaction, kShareStatements, erase.shares, put.shares));
          TF_RETURN_IF_ERROR(ChangeRows(transaction, kLinkStatements, erase.links, put.links));
          return ChangeRows(transaction, kRightStatements, erase.mesh_rights, put.mesh_rights);
        },
        deadline));
  });
}

}  // namespace tissueform
