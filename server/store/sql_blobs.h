// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/platform/storage/durable_file.h"
#include "server/store/sql_database.h"

namespace tissueform {

// The blob that a row claims.
struct BlobClaim {
  std::string sha256 = {};
  int64_t bytes = 0;
  std::string what = {};  // "mesh 0123...": of whom a message says that its bytes are gone
};

// Bytes that are named by their SHA-256 and never change, each claimed by rows: files beside an
// SQLite database (sqlite_blobs.h), rows in PostgreSQL (postgres_store/postgres_blobs.h).
//
// A blob is kept before the row that claims it, and goes after the last one has gone. All calls
// block. Thread-safe; must outlive its calls.
class SqlBlobs {
 public:
  // A blob that comes piece by piece. What has come goes with it, unless it was kept. One thread at
  // a time; must not outlive its SqlBlobs.
  class Incoming {
   public:
    virtual ~Incoming() = default;

    virtual absl::Status Append(absl::string_view bytes) = 0;
    // As Put, of all bytes. Once.
    virtual absl::Status Keep(const std::string& sha256, const SqlWork& claim) = 0;
  };
  // The row's claim. Called again where reading has to begin again.
  using FindClaim = std::function<absl::StatusOr<BlobClaim>(SqlTransaction&)>;
  using Sink = std::function<absl::Status(absl::string_view)>;
  // Deletes rows, and returns the blobs that they claimed; each was locked before (Lock).
  using Release = std::function<absl::StatusOr<std::vector<std::string>>(SqlTransaction&)>;

  virtual ~SqlBlobs() = default;

  // Keeps a blob, then the row that `claim` writes. When that fails the blob goes, unless another
  // row claims it. REQUIRES: sha256 is that of the parts one after the other.
  virtual absl::Status Put(const std::string& sha256, const std::vector<absl::string_view>& parts,
                           const SqlWork& claim) = 0;
  virtual absl::StatusOr<std::unique_ptr<Incoming>> Receive() = 0;

  // Calls `sink` for all bytes in order, which are what was kept when it returns OK. Errors: those
  // of `find`; DataLoss: they are not what was kept, or gone. They are set aside then.
  virtual absl::Status Read(const FindClaim& find, const Sink& sink) = 0;
  // For reading, also when it is removed meanwhile. Size is checked, the digest is not. Errors:
  // those of Read.
  virtual absl::StatusOr<OpenFile> Open(const FindClaim& find) = 0;

  // Nobody else claims or releases it until the transaction's end.
  virtual absl::Status Lock(SqlTransaction& transaction, const std::string& sha256) = 0;
  // Blobs that no row claims any longer are gone, also from the disk, when it returns.
  virtual absl::Status Remove(const Release& release) = 0;

  // Takes a damaged blob out of the store with all rows that claim it. Returns `damage`, or why
  // that failed.
  virtual absl::Status SetAside(const std::string& sha256, const absl::Status& damage) = 0;
};

// Deletes all rows that claim it.
absl::Status DeleteClaims(SqlTransaction& transaction, const std::string& sha256);

}  // namespace tissueform
