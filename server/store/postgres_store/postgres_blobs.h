// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/store/postgres_store/postgres_pool.h"

// Bytes named by their SHA-256, as rows of 1 MiB. A blob and the row that claims it are written in
// one transaction, and go in one: there are none that nobody claims. Whoever writes or removes a
// claim has locked its blob before (PutBlob, LockBlob), so that these take turns.
namespace tissueform {

inline constexpr int64_t kBlobPieceBytes = int64_t{1} << 20;

// `size` bytes from `offset` on; they are there.
using BlobSource = std::function<absl::StatusOr<std::string>(int64_t offset, int64_t size)>;
using BlobSink = std::function<absl::Status(absl::string_view)>;

// Bytes that lie one after the other; `parts` and what they show must outlive it.
BlobSource SourceOfParts(const std::vector<absl::string_view>& parts);

// Keeps a blob, or finds that it is there in full; locks it. REQUIRES: sha256 is that of all bytes.
absl::Status PutBlob(PostgresTransaction& transaction, const std::string& sha256, int64_t bytes,
                     const BlobSource& source);

// Nothing happens when it is not there.
absl::Status LockBlob(PostgresTransaction& transaction, const std::string& sha256);

// What is read from here on is of one moment. First of all in a transaction.
absl::Status ReadOneMoment(PostgresTransaction& transaction);

// Calls `sink` for all bytes in order, then checks the digest. REQUIRES: ReadOneMoment, and its
// claim was read in this transaction. Errors: DataLoss (it is not `bytes` long; bytes have another
// SHA-256), after whatever was given; those of `sink`.
absl::Status ReadBlob(PostgresTransaction& transaction, const std::string& sha256, int64_t bytes,
                      const BlobSink& sink);

// Removes the blob when no row claims it any longer. REQUIRES: it is locked.
absl::Status RemoveUnclaimedBlob(PostgresTransaction& transaction, const std::string& sha256);

// Takes a damaged blob out of the store: rows that claim it go, and its bytes stay under the name
// "damaged KEY SHA-256". Returns `damage`, or why that failed.
absl::Status SetPostgresBlobAside(PostgresPool* pool, const std::string& sha256,
                                  const absl::Status& damage);

}  // namespace tissueform
