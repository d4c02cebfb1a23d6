// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mesh/payload/sha256.h"

namespace tissueform {

// The key of a case: each user who has sent a file has a case of it.
struct CaseKey {
  std::string sha256 = {};
  std::string owner = {};

  friend auto operator<=>(const CaseKey&, const CaseKey&) = default;
};

// What is known of a case without reading it.
struct CaseRecord {
  std::string sha256 = {};  // of the file
  std::string owner = {};
  std::string project = {};  // empty: none
  std::string title = {};
  int64_t total_bytes = 0;
  int64_t created_s = 0;    // unix seconds
  int64_t last_used_s = 0;  // never goes back

  CaseKey key() const { return {.sha256 = sha256, .owner = owner}; }
};

// InvalidArgument for a record that no store keeps: no SHA-256, or a size that is not positive.
absl::Status CheckCaseRecord(const CaseRecord& record);

// A case that comes piece by piece. What has come goes with this object, unless it was kept. One
// thread at a time.
class CaseWriter {
 public:
  virtual ~CaseWriter() = default;

  // Adds bytes. Errors: InvalidArgument (`offset` is not where the next ones belong; past the
  // announced end), ResourceExhausted (the disk, or a server that keeps cases in memory, is full),
  // or what the disk says. No use after an error.
  absl::Status Write(int64_t offset, absl::string_view bytes);

  // Keeps the case, for good as far as the store does; returns it as it is kept. If the same case
  // has come since Begin, that one stays, and only its last_used_s rises. Once.
  //
  // Errors: InvalidArgument (bytes are missing), DataLoss (the digest is another: damaged on its
  // way), ResourceExhausted (there are as many as may be; the disk is full), or what the disk says.
  absl::StatusOr<CaseRecord> Finish();

 protected:
  explicit CaseWriter(CaseRecord record) : record_(std::move(record)) {}

  const CaseRecord& record() const { return record_; }
  virtual absl::Status Append(absl::string_view bytes) = 0;
  virtual absl::StatusOr<CaseRecord> Keep() = 0;

 private:
  const CaseRecord record_;
  int64_t written_bytes_ = 0;
  Sha256 digest_;
};

// The bytes of a case, which stay readable until its end, also when the case is deleted. One thread
// at a time.
class CaseReader {
 public:
  virtual ~CaseReader() = default;

  int64_t total_bytes() const { return total_bytes_; }

  // `size` bytes from `offset` on, fewer at the end. For a caller that reads all of them in order
  // from 0, the last call checks their digest.
  //
  // Errors: DataLoss (they are not what was kept; the case is set aside then), or what the disk
  // says. REQUIRES: 0 <= offset <= total_bytes(), size > 0.
  absl::StatusOr<std::string> Read(int64_t offset, int64_t size);

 protected:
  CaseReader(std::string sha256, int64_t total_bytes)
      : sha256_(std::move(sha256)), total_bytes_(total_bytes) {}

  const std::string& sha256() const { return sha256_; }
  // Fewer than `size` where there are no more.
  virtual absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) = 0;
  // Takes the case out of its store; returns `damage`, or why that did not work.
  virtual absl::Status SetAside(const absl::Status& damage) = 0;

 private:
  const std::string sha256_;
  const int64_t total_bytes_;
  int64_t digested_bytes_ = 0;
  Sha256 digest_;
};

// Where cases are kept: files that the server does not interpret, named by their SHA-256, one case
// for each of their owners. They never change.
//
// Calls block; durable when answered; thread-safe: as MeshStore. Writers and readers must not
// outlive their store.
class CaseStore {
 public:
  struct ListRequest {
    std::optional<std::string> owner = {};  // of this one only; unset: of all
    std::set<CaseKey> also = {};            // of others, where an owner is set
    std::string after = {};                 // names greater than this
    int limit = 100;                        // at least 1
  };
  struct Page {
    std::vector<CaseRecord> records;  // by key, rising
    std::string next;                 // give it as `after`; empty: that was all
  };

  virtual ~CaseStore() = default;

  // Begins to receive a case where fewer than `most` are kept. Errors: InvalidArgument
  // (CheckCaseRecord), ResourceExhausted, or what the disk says.
  virtual absl::StatusOr<std::unique_ptr<CaseWriter>> Begin(CaseRecord record, int most) = 0;

  // Errors: NotFound.
  virtual absl::StatusOr<CaseRecord> Find(const CaseKey& key) = 0;

  // Opens a case, which is a use of it. Errors: NotFound, DataLoss (set aside), or what the disk
  // says.
  virtual absl::StatusOr<std::unique_ptr<CaseReader>> Open(const CaseKey& key, int64_t now_s) = 0;

  // One case a name, where no name is both the owner's and in `also`, or there twice; else those of
  // one name may be parted by the end of a page. Errors: InvalidArgument (limit).
  virtual absl::StatusOr<Page> List(const ListRequest& request) = 0;

  // Errors: NotFound.
  virtual absl::Status Delete(const CaseKey& key) = 0;

  // last_used_s rises to it. Those that are not there are passed over.
  virtual absl::Status Touch(const CaseKey& key, int64_t now_s) = 0;

  // Deletes those that were not used since then, but the names in `spared`; at most `most`.
  // Returns them.
  virtual absl::StatusOr<std::vector<CaseKey>> RemoveUnused(int64_t before_s,
                                                            const std::set<std::string>& spared,
                                                            int most) = 0;
};

}  // namespace tissueform
