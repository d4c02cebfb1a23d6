// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_mesh_store.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_pages.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

absl::StatusOr<MeshRecord> ReadMeshRow(const PostgresRows& rows, size_t row) {
  return MeshOf(rows.Text(row, 0), rows.Text(row, 1), rows.Integer(row, 2));
}

absl::StatusOr<MeshRecord> FindMeshRow(PostgresTransaction& transaction,
                                       const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows,
      transaction.Query("SELECT sha256, record, last_used_s FROM meshes WHERE sha256 = $1",
                        {sha256}));
  if (rows.empty()) return NoMesh(sha256);
  return ReadMeshRow(rows, 0);
}

// Text of the shape, then the payload.
absl::StatusOr<MeshPayload> ReadMeshBlob(PostgresTransaction& transaction,
                                         const MeshRecord& record) {
  const std::string text = record.shape.Text();
  const auto text_bytes = static_cast<int64_t>(text.size());
  std::string head;  // the first bytes, until the text is whole
  MeshPayload payload(record.shape);
  int64_t offset = 0;
  TF_RETURN_IF_ERROR(ReadBlob(
      transaction, record.sha256, text_bytes + record.total_bytes, [&](absl::string_view piece) {
        const size_t of_text = std::min(text.size() - head.size(), piece.size());
        head.append(piece.data(), of_text);
        piece.remove_prefix(of_text);
        payload.Write(offset, piece);
        offset += static_cast<int64_t>(piece.size());
        return absl::OkStatus();
      }));
  if (head == text) return payload;
  return Damaged(absl::StrCat("mesh ", record.sha256), "its bytes belong to another mesh");
}

// No session of it is begun until the transaction's end.
absl::Status CheckNoSessionHasMesh(PostgresTransaction& transaction, const std::string& sha256) {
  TF_RETURN_IF_ERROR(
      transaction.Run("SELECT 1 FROM meshes WHERE sha256 = $1 FOR UPDATE", {sha256}));
  TF_ASSIGN_OR_RETURN(const PostgresRows rows,
                      transaction.Query("SELECT count(*) FROM sessions WHERE mesh = $1", {sha256}));
  const int64_t sessions = rows.Integer(0, 0);
  return sessions == 0 ? absl::OkStatus() : MeshHasSessions(sessions);
}

}  // namespace

absl::Status PostgresMeshStore::Put(const MeshRecord& record, const MeshPayloadView& payload) {
  TF_RETURN_IF_ERROR(CheckMeshRecord(record, payload));
  const std::string text = record.shape.Text();
  std::vector<absl::string_view> parts = {text};
  parts.insert(parts.end(), payload.segments.begin(), payload.segments.end());
  const int64_t total_bytes = static_cast<int64_t>(text.size()) + record.total_bytes;
  const std::string bytes = Seal(SerializeMesh(record));
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(PutBlob(transaction, record.sha256, total_bytes, SourceOfParts(parts)));
    return transaction.Run(
        "INSERT INTO meshes (sha256, record, last_used_s) VALUES ($1, $2, $3) ON CONFLICT (sha256) "
        "DO UPDATE SET last_used_s = GREATEST(meshes.last_used_s, excluded.last_used_s)",
        {record.sha256, bytes, record.last_used_s});
  });
}

absl::StatusOr<MeshRecord> PostgresMeshStore::Find(const std::string& sha256) {
  return AskPool<MeshRecord>(
      pool_, [&](PostgresTransaction& transaction) { return FindMeshRow(transaction, sha256); });
}

absl::StatusOr<MeshPayload> PostgresMeshStore::Read(const std::string& sha256) {
  absl::StatusOr<MeshPayload> payload = AskPool<MeshPayload>(
      pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<MeshPayload> {
        TF_RETURN_IF_ERROR(ReadOneMoment(transaction));
        TF_ASSIGN_OR_RETURN(const MeshRecord record, FindMeshRow(transaction, sha256));
        return ReadMeshBlob(transaction, record);
      });
  if (!absl::IsDataLoss(payload.status())) return payload;
  return SetPostgresBlobAside(pool_, sha256, payload.status());
}

absl::StatusOr<MeshStore::Page> PostgresMeshStore::List(const std::string& after, int limit) {
  if (limit < 1) return BadLimit(limit);
  return AskPool<Page>(pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(const PostgresRows rows,
                        transaction.Query("SELECT sha256, record, last_used_s FROM meshes WHERE "
                                          "sha256 > $1 ORDER BY sha256 LIMIT $2",
                                          {after, RowsOfPage(limit)}));
    return ReadPostgresPage<Page>(rows, limit, 0, ReadMeshRow);
  });
}

absl::Status PostgresMeshStore::Delete(const std::string& sha256) {
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(LockBlob(transaction, sha256));
    TF_RETURN_IF_ERROR(CheckNoSessionHasMesh(transaction, sha256));
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query("DELETE FROM meshes WHERE sha256 = $1 RETURNING key", {sha256}));
    if (rows.empty()) return NoMesh(sha256);
    return RemoveUnclaimedBlob(transaction, sha256);
  });
}

absl::Status PostgresMeshStore::Touch(const std::vector<std::string>& sha256s, int64_t now_s) {
  const std::string names = PostgresNames(sha256s);
  return pool_->Run([&](PostgresTransaction& transaction) {
    return transaction.Run(
        "UPDATE meshes SET last_used_s = $1 WHERE last_used_s < $1 AND key IN (SELECT key FROM "
        "meshes WHERE sha256 = ANY (string_to_array($2, chr(31))) ORDER BY key FOR "
        "UPDATE)",
        {now_s, names});
  });
}

absl::StatusOr<std::vector<MeshRecord>> PostgresMeshStore::ListUnused(int64_t before_s, int limit) {
  if (limit < 1) return BadLimit(limit);
  TF_ASSIGN_OR_RETURN(
      Page page,
      AskPool<Page>(pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
        TF_ASSIGN_OR_RETURN(
            const PostgresRows rows,
            transaction.Query("SELECT sha256, record, last_used_s FROM meshes WHERE last_used_s < "
                              "$1 ORDER BY last_used_s, sha256 LIMIT $2",
                              {before_s, int64_t{limit}}));
        return ReadPostgresPage<Page>(rows, limit, 0, ReadMeshRow);
      }));
  return std::move(page.records);
}

}  // namespace tissueform
