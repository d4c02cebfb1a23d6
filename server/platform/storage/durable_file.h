// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Files whose owner must know when they are on the disk. Errors of all: ResourceExhausted (the disk
// is full, or a limit on files), FailedPrecondition (read-only), NotFound, Unavailable (no folder
// to make a file in), or what the system says; they name the path and say what to do.

// What the system has said, as a Status; `what` begins the message ("cannot write").
absl::Status FileError(int error_number, absl::string_view what, const std::string& path);

// A descriptor that is closed at the end.
class OpenFile {
 public:
  OpenFile() = default;
  // `flags` as open(2); what is made is for the owner only (0600).
  static absl::StatusOr<OpenFile> Open(const std::string& path, int flags);

  ~OpenFile();
  OpenFile(OpenFile&& other) noexcept
      : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}
  OpenFile& operator=(OpenFile&& other) noexcept;

  int descriptor() const { return descriptor_; }
  absl::StatusOr<int64_t> Size() const;
  absl::Status WriteAt(int64_t offset, absl::string_view bytes);
  // Reads until `size` bytes or the end.
  absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) const;
  absl::Status Truncate(int64_t size);
  // On the disk when it returns.
  absl::Status Sync();

 private:
  OpenFile(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}

  std::string path_;
  int descriptor_ = -1;
};

// Makes the folder (0700) unless it is there. Its name is on the disk when the folder round it has
// been synced.
absl::Status MakeFolder(const std::string& path);

// Makes a new private folder (0700) "NAME-XXXXXX" in the system's temporary folder; returns its
// path.
absl::StatusOr<std::string> MakeTemporaryFolder(absl::string_view name);

// The names in a folder are on the disk when it returns.
absl::Status SyncFolder(const std::string& path);

// A file that appears at once: written under another name (PATH.N.new), synced, renamed; then its
// folder is synced. An old file of that name stays until then.
absl::Status WriteDurably(const std::string& path, const std::vector<absl::string_view>& parts);

// Gives a file that was synced its name, in the same folder, which is then synced.
absl::Status RenameDurably(const std::string& temporary, const std::string& path);

// NotFound when it is not there. The folder is not synced.
absl::Status RemoveFile(const std::string& path);

// Calls `sink` for all bytes of a file in order, in pieces. Ends with its first error.
absl::Status ReadInPieces(const std::string& path,
                          const std::function<absl::Status(absl::string_view)>& sink);

}  // namespace tissueform
