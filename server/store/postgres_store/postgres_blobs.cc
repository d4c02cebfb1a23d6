// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_blobs.h"

#include <algorithm>
#include <atomic>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

using Sink = SqlBlobs::Sink;

int64_t PiecesOf(int64_t bytes) {
  return (bytes + PostgresBlobs::kPieceBytes - 1) / PostgresBlobs::kPieceBytes;
}

absl::Status BadBlob(const std::string& sha256, absl::string_view why) {
  return Damaged(absl::StrCat("blob ", sha256), why);
}

// Writes the row of a blob, which locks it; returns its key.
absl::StatusOr<int64_t> PutBlobRow(SqlTransaction& transaction, const std::string& sha256,
                                   int64_t bytes) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query("INSERT INTO blobs (sha256, bytes) VALUES ($1, $2) ON CONFLICT (sha256) DO "
                        "UPDATE SET bytes = excluded.bytes RETURNING key",
                        {sha256, bytes}));
  return rows.Integer(0, 0);
}

absl::StatusOr<bool> HasAllPieces(SqlTransaction& transaction, int64_t key, int64_t bytes) {
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows,
      transaction.Query("SELECT count(*), coalesce(sum(length(bytes)), 0) FROM blob_pieces WHERE "
                        "blob = $1",
                        {key}));
  return rows.Integer(0, 0) == PiecesOf(bytes) && rows.Integer(0, 1) == bytes;
}

// Calls `sink` for all bytes in order, then checks the digest. REQUIRES: ReadOneMoment, and its
// claim was read in this transaction. Errors: DataLoss (it is not `bytes` long; bytes have another
// SHA-256; `sink` may have had some of them), and those of `sink`.
absl::Status ReadPieces(SqlTransaction& transaction, const BlobClaim& claim, const Sink& sink) {
  const auto& [sha256, bytes, what] = claim;
  Sha256 digest;
  int64_t read = 0;
  for (int64_t number = 0; number < PiecesOf(bytes); ++number) {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query("SELECT blob_pieces.sha256, blob_pieces.bytes FROM blobs JOIN "
                          "blob_pieces ON blob_pieces.blob = blobs.key WHERE blobs.sha256 = $1 AND "
                          "number = $2",
                          {sha256, number}));
    if (rows.empty()) return BadBlob(sha256, absl::StrCat("piece ", number, " is gone"));
    const absl::string_view piece = rows.Text(0, 1);
    read += static_cast<int64_t>(piece.size());
    if (read != std::min((number + 1) * PostgresBlobs::kPieceBytes, bytes)) {
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

// `size` bytes from `offset` on of parts that lie one after the other.
std::string BytesOfParts(const std::vector<absl::string_view>& parts, int64_t offset,
                         int64_t size) {
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
}

absl::StatusOr<OpenFile> OpenNamelessFile() {
  static std::atomic<unsigned> counter = 0;
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (error) return absl::UnavailableError("there is no temporary folder; set TMPDIR");
  const std::string path =
      absl::StrCat(folder.string(), "/tissueform-case.", getpid(), ".", counter++);
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(path, O_RDWR | O_CREAT | O_EXCL));
  unlink(path.c_str());
  return file;
}

}  // namespace

class PostgresBlobs::IncomingFile final : public Incoming {
 public:
  IncomingFile(PostgresBlobs* blobs, OpenFile file) : blobs_(blobs), file_(std::move(file)) {}

  absl::Status Append(absl::string_view bytes) override {
    TF_RETURN_IF_ERROR(file_.WriteAt(bytes_, bytes));
    bytes_ += static_cast<int64_t>(bytes.size());
    return absl::OkStatus();
  }
  absl::Status Keep(const std::string& sha256, const SqlWork& claim) override {
    const auto read = [this](int64_t offset, int64_t size) { return file_.ReadAt(offset, size); };
    return blobs_->PutFrom(sha256, bytes_, read, claim);
  }

 private:
  PostgresBlobs* const blobs_;
  OpenFile file_;
  int64_t bytes_ = 0;
};

absl::Status PostgresBlobs::PutFrom(const std::string& sha256, int64_t bytes, const Source& source,
                                    const SqlWork& claim) {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_ASSIGN_OR_RETURN(const int64_t key, PutBlobRow(transaction, sha256, bytes));
    TF_ASSIGN_OR_RETURN(const bool there, HasAllPieces(transaction, key, bytes));
    if (there) return claim(transaction);
    TF_RETURN_IF_ERROR(transaction.Run("DELETE FROM blob_pieces WHERE blob = $1", {key}));
    for (int64_t number = 0; number < PiecesOf(bytes); ++number) {
      const int64_t offset = number * kPieceBytes;
      TF_ASSIGN_OR_RETURN(const std::string piece,
                          source(offset, std::min(kPieceBytes, bytes - offset)));
      TF_RETURN_IF_ERROR(transaction.Run(
          "INSERT INTO blob_pieces (blob, number, sha256, bytes) VALUES ($1, $2, $3, $4)",
          {key, number, Sha256Hex({piece}), SqlBytes{piece}}));
    }
    return claim(transaction);
  });
}

absl::Status PostgresBlobs::Put(const std::string& sha256,
                                const std::vector<absl::string_view>& parts, const SqlWork& claim) {
  int64_t bytes = 0;
  for (const absl::string_view part : parts) bytes += static_cast<int64_t>(part.size());
  const auto read = [&parts](int64_t offset, int64_t size) {
    return BytesOfParts(parts, offset, size);
  };
  return PutFrom(sha256, bytes, read, claim);
}

absl::StatusOr<std::unique_ptr<SqlBlobs::Incoming>> PostgresBlobs::Receive() {
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenNamelessFile());
  return std::make_unique<IncomingFile>(this, std::move(file));
}

absl::Status PostgresBlobs::Read(const FindClaim& find, const Sink& sink) {
  std::string sha256;  // empty: its row is damaged, and nothing is known of its blob
  const absl::Status status = pool_->Run(
      [&](PostgresTransaction& transaction) -> absl::Status {
        TF_RETURN_IF_ERROR(transaction.ReadOneMoment());
        TF_ASSIGN_OR_RETURN(const BlobClaim claim, find(transaction));
        sha256 = claim.sha256;
        return ReadPieces(transaction, claim, sink);
      },
      PostgresPool::Idempotent::kYes);
  return absl::IsDataLoss(status) && !sha256.empty() ? SetAside(sha256, status) : status;
}

absl::StatusOr<OpenFile> PostgresBlobs::Open(const FindClaim& find) {
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenNamelessFile());
  int64_t bytes = 0;
  const auto find_anew = [&](SqlTransaction& transaction) {
    bytes = 0;
    return find(transaction);
  };
  TF_RETURN_IF_ERROR(Read(find_anew, [&](absl::string_view piece) {
    absl::Status status = file.WriteAt(bytes, piece);
    bytes += static_cast<int64_t>(piece.size());
    return status;
  }));
  return file;
}

absl::Status PostgresBlobs::Lock(SqlTransaction& transaction, const std::string& sha256) {
  return transaction.Run("SELECT 1 FROM blobs WHERE sha256 = $1 FOR UPDATE", {sha256});
}

absl::Status PostgresBlobs::Remove(const Release& release) {
  return pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_ASSIGN_OR_RETURN(const std::vector<std::string> released, release(transaction));
    for (const std::string& sha256 : released) {
      TF_RETURN_IF_ERROR(transaction.Run(
          "DELETE FROM blobs WHERE sha256 = $1 AND NOT EXISTS (SELECT 1 FROM meshes WHERE sha256 = "
          "$1) AND NOT EXISTS (SELECT 1 FROM cases WHERE sha256 = $1) AND NOT EXISTS (SELECT 1 "
          "FROM predictions WHERE positions_sha256 = $1)",
          {sha256}));
    }
    return absl::OkStatus();
  });
}

absl::Status PostgresBlobs::SetAside(const std::string& sha256, const absl::Status& damage) {
  const absl::Status status = pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
    TF_RETURN_IF_ERROR(Lock(transaction, sha256));
    TF_RETURN_IF_ERROR(DeleteClaims(transaction, sha256));
    return transaction.Run(
        "UPDATE blobs SET sha256 = 'damaged ' || key || ' ' || sha256 WHERE sha256 = $1", {sha256});
  });
  return status.ok() ? damage : status;
}

}  // namespace tissueform
