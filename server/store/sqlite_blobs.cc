// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sqlite_blobs.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/fault_points.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

constexpr int kReadAttempts = 3;

// Removes the blob when no row claims it.
absl::Status RemoveUnclaimed(Database& database, BlobStore& files, const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(const bool claimed, IsClaimed(database, sha256));
  return claimed ? absl::OkStatus() : files.Remove(sha256);
}

}  // namespace

absl::StatusOr<bool> IsClaimed(Database& database, const std::string& sha256) {
  Database::Query query = database.Prepare(
      "SELECT EXISTS (SELECT 1 FROM meshes WHERE sha256 = ?1) OR "
      "EXISTS (SELECT 1 FROM cases WHERE sha256 = ?1) OR "
      "EXISTS (SELECT 1 FROM predictions WHERE positions_sha256 = ?1)");
  TF_RETURN_IF_ERROR(query.Bind(sha256).Step().status());
  return query.Integer(0) != 0;
}

absl::Status CheckBlobSize(const BlobStore& files, const std::string& sha256, int64_t wanted) {
  TF_ASSIGN_OR_RETURN(const int64_t bytes, files.Size(sha256));
  if (bytes == wanted) return absl::OkStatus();
  return Damaged(absl::StrCat("the file of ", sha256),
                 absl::StrCat("it has ", bytes, " bytes, not ", wanted));
}

class SqliteBlobs::IncomingFile final : public Incoming {
 public:
  IncomingFile(SqliteBlobs* blobs, std::unique_ptr<BlobStore::Incoming> file)
      : blobs_(blobs), file_(std::move(file)) {}

  absl::Status Append(absl::string_view bytes) override { return file_->Append(bytes); }
  absl::Status Keep(const std::string& sha256, const SqlWork& claim) override {
    return blobs_->Claim(sha256, file_->Keep(sha256), claim);
  }

 private:
  SqliteBlobs* const blobs_;
  const std::unique_ptr<BlobStore::Incoming> file_;
};

absl::Status SqliteBlobs::Claim(const std::string& sha256, absl::StatusOr<BlobStore::Pin> pin,
                                const SqlWork& claim) {
  absl::Status status;
  {
    TF_ASSIGN_OR_RETURN(const BlobStore::Pin held, std::move(pin));
    TF_FAULT_POINT("claim.blob_kept");
    status = database_->Run({.work = claim});
  }
  if (!status.ok()) Remove([&](SqlTransaction&) { return std::vector{sha256}; }).IgnoreError();
  return status;
}

absl::Status SqliteBlobs::Put(const std::string& sha256,
                              const std::vector<absl::string_view>& parts, const SqlWork& claim) {
  return Claim(sha256, files_->Put(sha256, parts), claim);
}

absl::StatusOr<std::unique_ptr<SqlBlobs::Incoming>> SqliteBlobs::Receive() {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<BlobStore::Incoming> file, files_->Receive());
  return std::make_unique<IncomingFile>(this, std::move(file));
}

absl::Status SqliteBlobs::UseClaimed(const FindClaim& find,
                                     const std::function<absl::Status(const BlobClaim&)>& use) {
  BlobClaim claim;
  for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
    TF_ASSIGN_OR_RETURN(claim, ReadSql<BlobClaim>(database_, find));
    absl::Status status = CheckBlobSize(*files_, claim.sha256, claim.bytes);
    if (status.ok()) status = use(claim);
    if (absl::IsDataLoss(status)) return SetAside(claim.sha256, status);
    if (!absl::IsNotFound(status)) return status;
  }
  return SetAside(claim.sha256, Damaged(claim.what, "its file is missing"));
}

absl::Status SqliteBlobs::Read(const FindClaim& find, const Sink& sink) {
  return UseClaimed(find, [&](const BlobClaim& claim) { return files_->Read(claim.sha256, sink); });
}

absl::StatusOr<OpenFile> SqliteBlobs::Open(const FindClaim& find) {
  absl::StatusOr<OpenFile> file;
  TF_RETURN_IF_ERROR(UseClaimed(find, [&](const BlobClaim& claim) {
    file = files_->OpenBlob(claim.sha256);
    return file.status();
  }));
  return file;
}

absl::Status SqliteBlobs::Remove(const Release& release) {
  std::vector<std::string> released;
  return database_->thread().Run(
      {.work = OnSqlite([&](SqlTransaction& transaction) -> absl::Status {
         TF_ASSIGN_OR_RETURN(released, release(transaction));
         return absl::OkStatus();
       }),
       .after = [&](Database& database) -> absl::Status {
         for (const std::string& sha256 : released) {
           TF_RETURN_IF_ERROR(RemoveUnclaimed(database, *files_, sha256));
         }
         return absl::OkStatus();
       },
       .erases = true});
}

absl::Status SqliteBlobs::SetAside(const std::string& sha256, const absl::Status& damage) {
  const absl::Status status = database_->thread().Run(
      {.work =
           OnSqlite([&](SqlTransaction& transaction) { return DeleteClaims(transaction, sha256); }),
       .after = [&](Database&) { return files_->SetAside(sha256).status(); }});
  return status.ok() ? damage : status;
}

}  // namespace tissueform
