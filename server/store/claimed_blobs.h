// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/platform/storage/database.h"
#include "server/store/blob_store.h"
#include "server/store/commit_thread.h"

// What the stores have in common whose rows claim blobs. A blob is written on the caller's thread
// before its row and removed on the database's thread after the last row that claims it. All block.
namespace tissueform {

// Between the row and its blob others may delete both and make them again: a blob that is not there
// is damage only when its row still is after so many looks.
inline constexpr int kReadAttempts = 3;

// What `work` finds in rows.
template <typename Result>
absl::StatusOr<Result> Ask(CommitThread* thread,
                           const std::function<absl::StatusOr<Result>(Database&)>& work) {
  absl::StatusOr<Result> result;
  const absl::Status status = thread->Run({.work = [&](Database& database) {
    result = work(database);
    return result.status();
  }});
  return status.ok() ? std::move(result) : status;
}

// What stands in a page, after `limit` of them.
template <typename Page, typename Read, typename Name>
absl::StatusOr<Page> ReadPage(Database::Query* query, int limit, Read read, Name name) {
  Page page;
  for (;;) {
    const absl::StatusOr<bool> row = query->Step();
    if (!row.ok()) return row.status();
    if (!*row) return page;
    auto record = read(*query);
    if (!record.ok()) continue;  // damaged: whoever asks for it hears so
    if (page.records.size() == static_cast<size_t>(limit)) {
      page.next = name(page.records.back());
      return page;
    }
    page.records.push_back(*std::move(record));
  }
}

// Writes the row of a blob that was kept just now. When that fails the blob goes, unless another
// row claims it.
absl::Status Claim(CommitThread* thread, BlobStore* blobs, const std::string& sha256,
                   absl::StatusOr<BlobStore::Pin> pin,
                   const std::function<absl::Status(Database&)>& claim);

// Rows of a damaged blob go, and the blob is set aside. Returns `damage`, or why that failed.
absl::Status SetBlobAside(CommitThread* thread, BlobStore* blobs, const std::string& sha256,
                          const absl::Status& damage);

// OK when the blob has this size. NotFound, DataLoss.
absl::Status CheckBlobSize(const BlobStore& blobs, const std::string& sha256, int64_t wanted);

}  // namespace tissueform
