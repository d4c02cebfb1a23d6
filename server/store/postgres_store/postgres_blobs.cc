// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_blobs.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

int64_t PiecesOf(int64_t bytes) { return (bytes + kBlobPieceBytes - 1) / kBlobPieceBytes; }

absl::Status WritePieces(PostgresTransaction& transaction, int64_t key, int64_t bytes,
                         const BlobSource& source) {
  for (int64_t number = 0; number < PiecesOf(bytes); ++number) {
    const int64_t offset = number * kBlobPieceBytes;
    TF_ASSIGN_OR_RETURN(const std::string piece,
                        source(offset, std::min(kBlobPieceBytes, bytes - offset)));
    TF_RETURN_IF_ERROR(transaction.Run(
        "INSERT INTO blob_pieces (blob, number, sha256, bytes) VALUES ($1, $2, $3, $4)",
        {key, number, Sha256Hex({piece}), piece}));
  }
  return absl::OkStatus();
}

absl::Status BadBlob(const std::string& sha256, absl::string_view why) {
  return Damaged(absl::StrCat("blob ", sha256), why);
}

}  // namespace

BlobSource SourceOfParts(const std::vector<absl::string_view>& parts) {
  return [&parts](int64_t offset, int64_t size) -> absl::StatusOr<std::string> {
    std::string bytes;
    for (const absl::string_view part : parts) {
      const auto length = static_cast<int64_t>(part.size());
      const auto missing = size - static_cast<int64_t>(bytes.size());
      if (offset < length && missing > 0) {
        const absl::string_view piece =
            part.substr(static_cast<size_t>(offset), static_cast<size_t>(missing));
        bytes.append(piece.data(), piece.size());
      }
      offset = std::max(offset - length, int64_t{0});
    }
    return bytes;
  };
}

absl::Status PutBlob(PostgresTransaction& transaction, const std::string& sha256, int64_t bytes,
                     const BlobSource& source) {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  TF_ASSIGN_OR_RETURN(
      const PostgresRows blob,
      transaction.Query("INSERT INTO blobs (sha256, bytes) VALUES ($1, $2) ON CONFLICT (sha256) DO "
                        "UPDATE SET bytes = excluded.bytes RETURNING key",
                        {sha256, bytes}));
  const int64_t key = blob.Integer(0, 0);
  TF_ASSIGN_OR_RETURN(
      const PostgresRows there,
      transaction.Query("SELECT count(*), coalesce(sum(length(bytes)), 0) FROM blob_pieces WHERE "
                        "blob = $1",
                        {key}));
  if (there.Integer(0, 0) == PiecesOf(bytes) && there.Integer(0, 1) == bytes) {
    return absl::OkStatus();
  }
  TF_RETURN_IF_ERROR(transaction.Run("DELETE FROM blob_pieces WHERE blob = $1", {key}));
  return WritePieces(transaction, key, bytes, source);
}

absl::Status LockBlob(PostgresTransaction& transaction, const std::string& sha256) {
  return transaction.Run("SELECT 1 FROM blobs WHERE sha256 = $1 FOR UPDATE", {sha256});
}

absl::Status ReadOneMoment(PostgresTransaction& transaction) {
  return transaction.Execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY");
}

absl::Status ReadBlob(PostgresTransaction& transaction, const std::string& sha256, int64_t bytes,
                      const BlobSink& sink) {
  Sha256 digest;
  int64_t read = 0;
  for (int64_t number = 0; number < PiecesOf(bytes); ++number) {
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query("SELECT blob_pieces.sha256, blob_pieces.bytes FROM blobs JOIN "
                          "blob_pieces ON blob_pieces.blob = blobs.key WHERE blobs.sha256 = $1 AND "
                          "number = $2",
                          {sha256, number}));
    if (rows.empty()) return BadBlob(sha256, absl::StrCat("piece ", number, " is gone"));
    const absl::string_view piece = rows.Text(0, 1);
    read += static_cast<int64_t>(piece.size());
    if (read != std::min((number + 1) * kBlobPieceBytes, bytes)) {
      return BadBlob(sha256, absl::StrCat("piece ", number, " has another size"));
    }
    if (Sha256Hex({piece}) != rows.Text(0, 0)) {
      return BadBlob(sha256, absl::StrCat("piece ", number, " has changed bytes"));
    }
    digest.Add(piece);
    TF_RETURN_IF_ERROR(sink(piece));
  }
  if (digest.Hex() == sha256) return absl::OkStatus();
  return BadBlob(sha256, "its SHA-256 does not match its name");
}

absl::Status RemoveUnclaimedBlob(PostgresTransaction& transaction, const std::string& sha256) {
  return transaction.Run(
      "DELETE FROM blobs WHERE sha256 = $1 AND NOT EXISTS (SELECT 1 FROM meshes WHERE sha256 = $1) "
      "AND NOT EXISTS (SELECT 1 FROM cases WHERE sha256 = $1) AND NOT EXISTS (SELECT 1 FROM "
      "predictions WHERE positions_sha256 = $1)",
      {sha256});
}

absl::Status SetPostgresBlobAside(PostgresPool* pool, const std::string& sha256,
                                  const absl::Status& damage) {
  const absl::Status status = pool->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(LockBlob(transaction, sha256));
    for (const char* statement :
         {"UPDATE sessions SET mesh = NULL WHERE mesh = $1", "DELETE FROM meshes WHERE sha256 = $1",
          "DELETE FROM cases WHERE sha256 = $1",
          "DELETE FROM predictions WHERE positions_sha256 = $1",
          "UPDATE blobs SET sha256 = 'damaged ' || key || ' ' || sha256 WHERE sha256 = $1"}) {
      TF_RETURN_IF_ERROR(transaction.Run(statement, {sha256}));
    }
    return absl::OkStatus();
  });
  return status.ok() ? damage : status;
}

}  // namespace tissueform
