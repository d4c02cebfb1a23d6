// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/sql_blobs.h"
#include "server/store/sqlite_database.h"

namespace tissueform {

// Blobs as files next to an SQLite database. A file is written on the caller's thread before its
// row and removed on the database's thread after its last row, so a crash leaves at worst a file
// without a row.
class SqliteBlobs final : public SqlBlobs {
 public:
  // Both must outlive it.
  SqliteBlobs(SqliteDatabase* database, BlobStore* files) : database_(database), files_(files) {}

  absl::Status Put(const std::string& sha256, const std::vector<absl::string_view>& parts,
                   const SqlWork& claim) override;
  absl::StatusOr<std::unique_ptr<Incoming>> Receive() override;
  absl::Status Read(const FindClaim& find, const Sink& sink) override;
  absl::StatusOr<OpenFile> Open(const FindClaim& find) override;
  // One thread changes rows, and files are removed after them: there is nothing to lock.
  absl::Status Lock(SqlTransaction& /*transaction*/, const std::string& /*sha256*/) override {
    return absl::OkStatus();
  }
  absl::Status Remove(const Release& release) override;
  absl::Status SetAside(const std::string& sha256, const absl::Status& damage) override;

 private:
  class IncomingFile;

  absl::Status Claim(const std::string& sha256, absl::StatusOr<BlobStore::Pin> pin,
                     const SqlWork& claim);
  // Calls `use` for the blob of a row. A missing file is damage only if it is missing several
  // times: another thread may delete row and file between the two reads.
  absl::Status UseClaimed(const FindClaim& find,
                          const std::function<absl::Status(const BlobClaim&)>& use);

  SqliteDatabase* const database_;
  BlobStore* const files_;
};

// OK when the blob has this size. NotFound, DataLoss.
absl::Status CheckBlobSize(const BlobStore& files, const std::string& sha256, int64_t wanted);

// Whether a row claims it.
absl::StatusOr<bool> IsClaimed(Database& database, const std::string& sha256);

}  // namespace tissueform
