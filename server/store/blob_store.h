// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {

// Files that are named by the SHA-256 of their bytes (so `sha256sum` checks them) and never change.
// They are written before the row that claims them and removed after the last one has gone: a file
// that no row claims is the worst that a crash leaves.
//
// Errors are those of durable_file.h. Thread-safe.
class BlobStore {
 public:
  // Keeps a blob from being removed between its writing and the commit of its row.
  class Pin {
   public:
    Pin(Pin&& other) noexcept
        : store_(std::exchange(other.store_, nullptr)), sha256_(std::move(other.sha256_)) {}
    Pin& operator=(Pin&&) = delete;
    ~Pin();

   private:
    friend class BlobStore;
    Pin(BlobStore* store, std::string sha256) : store_(store), sha256_(std::move(sha256)) {}

    BlobStore* store_;
    std::string sha256_;
  };

  // A blob that comes piece by piece, as a file that is removed with it, or at the next start,
  // unless it was kept. One thread at a time; must not outlive its store.
  class Incoming {
   public:
    ~Incoming();
    Incoming(const Incoming&) = delete;
    Incoming& operator=(const Incoming&) = delete;

    absl::Status Append(absl::string_view bytes);
    // The blob is on the disk when it returns; one of this name and size that is there stays. Once.
    // REQUIRES: sha256 is that of all bytes.
    absl::StatusOr<Pin> Keep(const std::string& sha256);

   private:
    friend class BlobStore;
    Incoming(BlobStore* store, std::string path, OpenFile file)
        : store_(store), path_(std::move(path)), file_(std::move(file)) {}

    BlobStore* const store_;
    const std::string path_;
    OpenFile file_;
    int64_t bytes_ = 0;
  };

  // Creates the folder if it does not exist, and removes what a crash has left half-written.
  static absl::StatusOr<std::unique_ptr<BlobStore>> Open(std::string folder,
                                                         std::string damaged_folder);

  // The blob is on the disk when it returns; one of this name and size that is there stays.
  // REQUIRES: sha256 is that of the parts one after the other.
  absl::StatusOr<Pin> Put(const std::string& sha256, const std::vector<absl::string_view>& parts);

  absl::StatusOr<std::unique_ptr<Incoming>> Receive();

  // Calls `sink` for all bytes in order; then checks the digest: DataLoss, when it is another,
  // after all was given. NotFound.
  absl::Status Read(const std::string& sha256,
                    const std::function<absl::Status(absl::string_view)>& sink);
  // Opens it for reading, which still works after its removal. The digest is not checked. Errors:
  // NotFound.
  absl::StatusOr<OpenFile> OpenBlob(const std::string& sha256) const;
  // Errors: NotFound.
  absl::StatusOr<int64_t> Size(const std::string& sha256) const;

  // Nothing happens when it is pinned or not there. It is gone from the disk when it returns.
  absl::Status Remove(const std::string& sha256);

  // Moves a damaged blob to the folder of what is damaged; returns its path there, or nothing when
  // it is not there.
  absl::StatusOr<std::string> SetAside(const std::string& sha256);

  // Names of all, those written last first.
  absl::StatusOr<std::vector<std::string>> List() const;

 private:
  BlobStore(std::string folder, std::string damaged_folder)
      : folder_(std::move(folder)), damaged_folder_(std::move(damaged_folder)) {}

  Pin PinTo(const std::string& sha256);
  // True when a blob of this name and size is on the disk.
  absl::StatusOr<bool> Has(const std::string& sha256, int64_t bytes) const;
  std::string Path(const std::string& sha256) const { return folder_ + "/" + sha256; }

  const std::string folder_;
  const std::string damaged_folder_;

  Mutex mutex_;  // also held while a file is removed, so that no caller finds it just then
  std::map<std::string, int> pins_ ABSL_GUARDED_BY(mutex_);
};

// Moves a file to a folder, which is made, under its name or that with a number; returns the new
// path.
absl::StatusOr<std::string> MoveInto(const std::string& folder, const std::string& path);

}  // namespace tissueform
