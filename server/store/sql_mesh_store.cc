// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_mesh_store.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/access_queries.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

absl::StatusOr<MeshRecord> FindRow(SqlTransaction& transaction, const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query(TF_SELECT_MESHES "WHERE sha256 = $1", {sha256}));
  if (rows.empty()) return NoMesh(sha256);
  return ReadMesh(rows, 0);
}

// Also locks the mesh, so no session of it is created until the transaction ends.
absl::Status CheckNoSessionHasMesh(SqlTransaction& transaction, const std::string& sha256) {
  TF_RETURN_IF_ERROR(
      transaction.Run("SELECT 1 FROM meshes WHERE sha256 = $1 FOR UPDATE", {sha256}));
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query("SELECT count(*) FROM sessions WHERE mesh = $1", {sha256}));
  const int64_t sessions = rows.Integer(0, 0);
  return sessions == 0 ? absl::OkStatus() : MeshHasSessions(sessions);
}

// Collects a mesh from the pieces of its blob: the text of its shape, then the payload.
class ArrivingMesh {
 public:
  explicit ArrivingMesh(const MeshRecord& record)
      : text_(record.shape.Text()), payload_(record.shape), sha256_(record.sha256) {}

  absl::Status Add(absl::string_view piece) {
    const size_t of_text = std::min(text_.size() - head_.size(), piece.size());
    head_.append(piece.data(), of_text);
    piece.remove_prefix(of_text);
    if (head_.size() == text_.size() && head_ != text_) {
      return Damaged(absl::StrCat("mesh ", sha256_), "its bytes belong to another mesh");
    }
    payload_.Write(offset_, piece);
    offset_ += static_cast<int64_t>(piece.size());
    return absl::OkStatus();
  }

  MeshPayload Take() { return std::move(payload_); }

 private:
  const std::string text_;
  MeshPayload payload_;
  const std::string sha256_;
  std::string head_;  // the first bytes, until the text is complete
  int64_t offset_ = 0;
};

}  // namespace

BlobClaim ClaimOf(const MeshRecord& record) {
  return {.sha256 = record.sha256,
          .bytes = static_cast<int64_t>(record.shape.Text().size()) + record.total_bytes,
          .what = absl::StrCat("mesh ", record.sha256)};
}

absl::Status SqlMeshStore::Put(const MeshRecord& record, const MeshPayloadView& payload) {
  TF_RETURN_IF_ERROR(CheckMeshRecord(record, payload));
  const std::string text = record.shape.Text();
  std::vector<absl::string_view> parts = {text};
  parts.insert(parts.end(), payload.segments.begin(), payload.segments.end());
  const std::string bytes = Seal(SerializeMesh(record));
  return blobs_->Put(record.sha256, parts, [&](SqlTransaction& transaction) {
    return transaction.Run(
        "INSERT INTO meshes (sha256, record, last_used_s) VALUES ($1, $2, $3) ON CONFLICT (sha256) "
        "DO UPDATE SET last_used_s = GREATEST(meshes.last_used_s, excluded.last_used_s)",
        {record.sha256, SqlBytes{bytes}, record.last_used_s});
  });
}

absl::StatusOr<MeshRecord> SqlMeshStore::Find(const std::string& sha256) {
  return ReadSql<MeshRecord>(
      database_, [&](SqlTransaction& transaction) { return FindRow(transaction, sha256); });
}

absl::StatusOr<MeshPayload> SqlMeshStore::Read(const std::string& sha256) {
  std::optional<ArrivingMesh> mesh;
  const auto find = [&](SqlTransaction& transaction) -> absl::StatusOr<BlobClaim> {
    TF_ASSIGN_OR_RETURN(const MeshRecord record, FindRow(transaction, sha256));
    mesh.emplace(record);
    return ClaimOf(record);
  };
  TF_RETURN_IF_ERROR(
      blobs_->Read(find, [&mesh](absl::string_view piece) { return mesh->Add(piece); }));
  return mesh->Take();
}

absl::StatusOr<MeshStore::Page> SqlMeshStore::List(const std::string& after, int limit) {
  if (limit < 1) return BadLimit(limit);
  return ReadSql<Page>(database_, [&](SqlTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query(TF_SELECT_MESHES "WHERE sha256 > $1 ORDER BY sha256 LIMIT $2",
                          {after, RowsOfPage(limit)}));
    return ReadPage<Page>(rows, limit, 0, ReadMesh);
  });
}

absl::Status SqlMeshStore::Delete(const std::string& sha256) {
  using Names = std::vector<std::string>;
  return blobs_->Remove([&](SqlTransaction& transaction) -> absl::StatusOr<Names> {
    TF_RETURN_IF_ERROR(blobs_->Lock(transaction, sha256));
    TF_RETURN_IF_ERROR(CheckNoSessionHasMesh(transaction, sha256));
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query("DELETE FROM meshes WHERE sha256 = $1 RETURNING key", {sha256}));
    if (rows.empty()) return NoMesh(sha256);
    TF_RETURN_IF_ERROR(EraseAccessToMesh(transaction, sha256));
    return Names{sha256};
  });
}

absl::Status SqlMeshStore::Touch(const std::vector<std::string>& sha256s, int64_t now_s) {
  const std::string names = SqlNames(sha256s);
  return database_->Run(
      {.work =
           [&](SqlTransaction& transaction) {
             return transaction.Run(
                 "UPDATE meshes SET last_used_s = $1 WHERE last_used_s < $1 AND key IN (SELECT key "
                 "FROM meshes WHERE sha256 = ANY (string_to_array($2, chr(31))) ORDER BY key FOR "
                 "UPDATE)",
                 {now_s, names});
           },
       .repeatable = true});
}

absl::StatusOr<std::vector<MeshRecord>> SqlMeshStore::ListUnused(int64_t before_s, int limit) {
  if (limit < 1) return BadLimit(limit);
  TF_ASSIGN_OR_RETURN(
      Page page, ReadSql<Page>(database_, [&](SqlTransaction& transaction) -> absl::StatusOr<Page> {
        TF_ASSIGN_OR_RETURN(
            const SqlRows rows,
            transaction.Query(TF_SELECT_MESHES
                              "WHERE last_used_s < $1 ORDER BY last_used_s, sha256 LIMIT $2",
                              {before_s, int64_t{limit}}));
        return ReadPage<Page>(rows, limit, 0, ReadMesh);
      }));
  return std::move(page.records);
}

}  // namespace tissueform
