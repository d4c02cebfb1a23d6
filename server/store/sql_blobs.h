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

// The blob that a row refers to (claims).
struct BlobClaim {
  std::string sha256 = {};
  int64_t bytes = 0;
  std::string what = {};  // "mesh 0123...": named in the message if its bytes are missing
};

// Bytes that are named by their SHA-256 and never change, each claimed by rows: files beside an
// SQLite database (sqlite_blobs.h), rows in PostgreSQL (postgres_store/postgres_blobs.h).
//
// A blob is stored before the row that claims it and removed after the last such row. All calls
// block. Thread-safe; must outlive its calls.
class SqlBlobs {
 public:
  // A blob that arrives in pieces. They are deleted with this object unless Keep succeeded. One
  // thread at a time; must not outlive its SqlBlobs.
  class Incoming {
   public:
    virtual ~Incoming() = default;

    virtual absl::Status Append(absl::string_view bytes) = 0;
    // As Put, for all pieces. Call it once.
    virtual absl::Status Keep(const std::string& sha256, const SqlWork& claim) = 0;
  };
  // Reads the row and returns its claim. Called again if reading restarts.
  using FindClaim = std::function<absl::StatusOr<BlobClaim>(SqlTransaction&)>;
  using Sink = std::function<absl::Status(absl::string_view)>;
  // Deletes rows and returns the blobs that they claimed. REQUIRES: each blob was locked (Lock).
  using Release = std::function<absl::StatusOr<std::vector<std::string>>(SqlTransaction&)>;

  virtual ~SqlBlobs() = default;

  // Stores a blob, then the row that `claim` writes. If that fails, the blob is removed unless
  // another row claims it. REQUIRES: sha256 is that of the parts one after the other.
  virtual absl::Status Put(const std::string& sha256, const std::vector<absl::string_view>& parts,
                           const SqlWork& claim) = 0;
  virtual absl::StatusOr<std::unique_ptr<Incoming>> Receive() = 0;

  // Calls `sink` for all bytes in order. OK: their digest was correct. Errors: those of `find` and
  // `sink`; DataLoss: the bytes are damaged or missing; the blob was set aside.
  virtual absl::Status Read(const FindClaim& find, const Sink& sink) = 0;
  // Opens a blob for reading, which still works after its removal. Checks the size, not the digest.
  // Errors: those of Read.
  virtual absl::StatusOr<OpenFile> Open(const FindClaim& find) = 0;

  // Other transactions cannot claim or release it until this one ends.
  virtual absl::Status Lock(SqlTransaction& transaction, const std::string& sha256) = 0;
  // Runs `release`; blobs without claims are deleted from the disk before it returns.
  virtual absl::Status Remove(const Release& release) = 0;

  // Moves a damaged blob out of the store and deletes all rows that claim it. Returns `damage`, or
  // the error of doing so.
  virtual absl::Status SetAside(const std::string& sha256, const absl::Status& damage) = 0;
};

// Deletes all rows that claim it.
absl::Status DeleteClaims(SqlTransaction& transaction, const std::string& sha256);

}  // namespace tissueform
