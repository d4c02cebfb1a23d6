// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/access_store/durable_access_store.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/access_store/access_rows.h"
#include "server/store/claimed_blobs.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

struct AccessTable {
  const char* select;
  const char* erase;
  const char* put;
};
constexpr AccessTable kShares = {"SELECT name, record FROM shares ORDER BY name",
                                 "DELETE FROM shares WHERE name = ?",
                                 "INSERT OR REPLACE INTO shares (name, record) VALUES (?, ?)"};
constexpr AccessTable kLinks = {"SELECT name, record FROM follow_links ORDER BY name",
                                "DELETE FROM follow_links WHERE name = ?",
                                "INSERT OR REPLACE INTO follow_links (name, record) VALUES (?, ?)"};
constexpr AccessTable kMeshRights = {
    "SELECT name, record FROM mesh_rights ORDER BY name", "DELETE FROM mesh_rights WHERE name = ?",
    "INSERT OR REPLACE INTO mesh_rights (name, record) VALUES (?, ?)"};

template <typename Row>
absl::Status LoadTable(Database& database, const AccessTable& table, std::vector<Row>* rows) {
  Database::Query query = database.Prepare(table.select);
  for (;;) {
    TF_ASSIGN_OR_RETURN(const bool found, query.Step());
    if (!found) return absl::OkStatus();
    Row row;
    const absl::StatusOr<absl::string_view> bytes = Unseal(query.Bytes(1));
    if (!bytes.ok() || !ParseRow(*bytes, &row).ok() || KeyOf(row) != query.Text(0)) continue;
    rows->push_back(std::move(row));
  }
}

template <typename Row>
absl::Status EraseRows(Database& database, const AccessTable& table, const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    const std::string key = KeyOf(row);
    TF_RETURN_IF_ERROR(database.Prepare(table.erase).Bind(key).Run());
  }
  return absl::OkStatus();
}

template <typename Row>
absl::Status PutRows(Database& database, const AccessTable& table, const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    const std::string key = KeyOf(row);
    const std::string bytes = Seal(SerializeRow(row));
    TF_RETURN_IF_ERROR(database.Prepare(table.put).Bind(key).BindBytes(bytes).Run());
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<AccessRows> DurableAccessStore::Load() {
  return Ask<AccessRows>(thread_, [](Database& database) -> absl::StatusOr<AccessRows> {
    AccessRows rows;
    TF_RETURN_IF_ERROR(LoadTable(database, kShares, &rows.shares));
    TF_RETURN_IF_ERROR(LoadTable(database, kLinks, &rows.links));
    TF_RETURN_IF_ERROR(LoadTable(database, kMeshRights, &rows.mesh_rights));
    return rows;
  });
}

void DurableAccessStore::Change(AccessRows erase, AccessRows put,
                                std::function<void(absl::Status)> done) {
  const bool erases = !erase.shares.empty() || !erase.links.empty() || !erase.mesh_rights.empty();
  thread_->Submit({.work = [erase = std::move(erase),
                            put = std::move(put)](Database& database) -> absl::Status {
                     TF_RETURN_IF_ERROR(EraseRows(database, kShares, erase.shares));
                     TF_RETURN_IF_ERROR(EraseRows(database, kLinks, erase.links));
                     TF_RETURN_IF_ERROR(EraseRows(database, kMeshRights, erase.mesh_rights));
                     TF_RETURN_IF_ERROR(PutRows(database, kShares, put.shares));
                     TF_RETURN_IF_ERROR(PutRows(database, kLinks, put.links));
                     return PutRows(database, kMeshRights, put.mesh_rights);
                   },
                   .erases = erases,
                   .done = std::move(done)});
}

}  // namespace tissueform
