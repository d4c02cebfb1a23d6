// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// What the system says of a file by this number, with its path: ResourceExhausted (DISK_FULL) where
// there is no room.
absl::Status ErrorOfFile(int error_number, const std::string& path);

// A file that a library writes by its name, and that gets its final name only when it is whole and
// on the disk. Its name ends in ".partial" by custom, to identify what a crash leaves.
class PartialFile {
 public:
  // An empty file that its owner alone may read, in place of what a crash has left there.
  //
  // Errors name the file: NotFound (no such folder), PermissionDenied, ResourceExhausted (disk
  // full: DISK_FULL), or what the system says.
  static absl::StatusOr<PartialFile> Create(std::string path);
  // Removes what has not been published.
  ~PartialFile();
  PartialFile(PartialFile&& other) noexcept;
  PartialFile& operator=(PartialFile&&) = delete;

  const std::string& path() const { return path_; }

  // Syncs it, gives it its name, in place of a file there, and syncs the folder, which is that of
  // the partial file too. Once.
  absl::Status Publish(const std::string& goal);

 private:
  explicit PartialFile(std::string path) : path_(std::move(path)) {}

  std::string path_;  // empty: published or moved from
};

}  // namespace tissueform
