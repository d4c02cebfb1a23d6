// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_access_store.h"

#include <utility>

#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "server/store/access_queries.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

absl::Status NoRoom() { return absl::ResourceExhaustedError("too many rows of rights"); }

absl::Status Write(SqlDatabase* database, SqlWork work, bool erases = false) {
  return database->Run({.work = std::move(work), .repeatable = true, .erases = erases});
}

absl::Status NoSuchRow() { return absl::NotFoundError("no such row"); }

// Locks the row of the resource, so that it is not deleted until the transaction ends. Errors:
// NotFound.
absl::Status LockResource(SqlTransaction& transaction, const ShareRow& share) {
  absl::string_view name = share.resource;
  const char* select = nullptr;
  if (absl::ConsumePrefix(&name, "sessions/")) {
    select = "SELECT 1 FROM sessions WHERE id = $1 AND owner = $2 FOR UPDATE";
  } else if (absl::ConsumePrefix(&name, "predictions/")) {
    select = "SELECT 1 FROM predictions WHERE id = $1 AND owner = $2 FOR UPDATE";
  } else if (absl::ConsumePrefix(&name, "cases/")) {
    select = "SELECT 1 FROM cases WHERE sha256 = $1 AND owner = $2 FOR UPDATE";
  } else {
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query(select, {name, share.owner}));
  return rows.empty() ? NoSuchRow() : absl::OkStatus();
}

absl::Status CheckShareRoom(SqlTransaction& transaction, const ShareRow& share, int most) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query("SELECT count(*) FROM shares WHERE resource = $1 AND owner = $2 AND "
                        "principal <> $3",
                        {share.resource, share.owner, share.principal}));
  return rows.Integer(0, 0) < most ? absl::OkStatus() : NoRoom();
}

absl::Status InsertShare(SqlTransaction& transaction, const ShareRow& share) {
  const std::string key = KeyOf(share);
  const std::string record = Seal(SerializeRow(share));
  return transaction.Run(
      "INSERT INTO shares (name, record, owner, resource, principal) VALUES ($1, $2, $3, $4, $5) "
      "ON CONFLICT (name) DO UPDATE SET record = excluded.record",
      {key, SqlBytes{record}, share.owner, share.resource, share.principal});
}

absl::Status InsertLink(SqlTransaction& transaction, const FollowLinkRow& link) {
  const std::string record = Seal(SerializeRow(link));
  return transaction.Run(
      "INSERT INTO follow_links (name, record, session, maker, expires_s) VALUES ($1, $2, $3, $4, "
      "$5) ON CONFLICT (name) DO UPDATE SET record = excluded.record",
      {link.digest, SqlBytes{record}, link.session, link.maker, link.expires_s});
}

absl::Status CheckLinkRoom(SqlTransaction& transaction, const std::string& session, int most) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows found,
      transaction.Query("SELECT 1 FROM sessions WHERE id = $1 FOR UPDATE", {session}));
  if (found.empty()) return NoSuchRow();
  TF_ASSIGN_OR_RETURN(
      const SqlRows links,
      transaction.Query("SELECT count(*) FROM follow_links WHERE session = $1", {session}));
  return links.Integer(0, 0) < most ? absl::OkStatus() : NoRoom();
}

}  // namespace

absl::StatusOr<std::vector<ShareRow>> SqlAccessStore::SharesOf(const std::string& owner,
                                                               const std::string& resource) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows, ReadSql<SqlRows>(database_, [&](SqlTransaction& transaction) {
        return transaction.Query(
            "SELECT name, record FROM shares WHERE resource = $1 AND owner = $2 ORDER BY principal",
            {resource, owner});
      }));
  std::vector<ShareRow> shares;
  for (size_t row = 0; row < rows.size(); ++row) {
    ShareRow share;
    const absl::StatusOr<absl::string_view> bytes = Unseal(rows.Text(row, 1));
    if (!bytes.ok() || !ParseRow(*bytes, &share).ok() || KeyOf(share) != rows.Text(row, 0))
      continue;
    shares.push_back(std::move(share));
  }
  return shares;
}

absl::Status SqlAccessStore::PutShare(const ShareRow& share, int most) {
  return Write(database_, [&](SqlTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(LockResource(transaction, share));
    TF_RETURN_IF_ERROR(CheckShareRoom(transaction, share, most));
    return InsertShare(transaction, share);
  });
}

absl::Status SqlAccessStore::EraseShare(const ShareRow& share) {
  const std::string key = KeyOf(share);
  // Not repeatable: a second run would find no share.
  return database_->Run(
      {.work = [&](SqlTransaction& transaction) -> absl::Status {
         TF_ASSIGN_OR_RETURN(
             const SqlRows rows,
             transaction.Query("DELETE FROM shares WHERE name = $1 RETURNING key", {key}));
         return rows.empty() ? NoSuchRow() : absl::OkStatus();
       },
       .erases = true});
}

absl::Status SqlAccessStore::PutLink(const FollowLinkRow& link, int64_t now_s, int most) {
  return Write(
      database_,
      [&](SqlTransaction& transaction) -> absl::Status {
        TF_RETURN_IF_ERROR(
            transaction.Run("DELETE FROM follow_links WHERE expires_s <= $1", {now_s}));
        TF_RETURN_IF_ERROR(CheckLinkRoom(transaction, link.session, most));
        return InsertLink(transaction, link);
      },
      /*erases=*/true);
}

absl::Status SqlAccessStore::EraseLinks(const std::string& session) {
  return Write(
      database_,
      [&](SqlTransaction& transaction) {
        return transaction.Run("DELETE FROM follow_links WHERE session = $1", {session});
      },
      /*erases=*/true);
}

absl::Status SqlAccessStore::PutMeshRight(const MeshRight& right) {
  const std::string key = KeyOf(right);
  const std::string record = Seal(SerializeRow(right));
  return Write(database_, [&](SqlTransaction& transaction) {
    return transaction.Run(
        "INSERT INTO mesh_rights (name, record, principal, sha256, bytes) VALUES ($1, $2, $3, $4, "
        "$5) ON CONFLICT (name) DO UPDATE SET record = excluded.record, bytes = excluded.bytes",
        {key, SqlBytes{record}, right.principal, right.sha256, right.bytes});
  });
}

absl::Status SqlAccessStore::EraseMeshRight(const std::string& principal,
                                            const std::string& sha256) {
  const std::string key = KeyOf(MeshRight{.principal = principal, .sha256 = sha256});
  return Write(
      database_,
      [&](SqlTransaction& transaction) {
        return transaction.Run("DELETE FROM mesh_rights WHERE name = $1", {key});
      },
      /*erases=*/true);
}

absl::Status SqlAccessStore::EraseMeshRights(const std::string& sha256) {
  return Write(
      database_,
      [&](SqlTransaction& transaction) { return EraseAccessToMesh(transaction, sha256); },
      /*erases=*/true);
}

bool HasNoRoom(const absl::Status& status) { return status == NoRoom(); }

}  // namespace tissueform
