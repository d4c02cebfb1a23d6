// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include <sys/types.h>

namespace tissueform {

// $XDG_STATE_HOME/tissueform, or ~/.local/state/tissueform.
// Errors: FailedPrecondition (neither variable is an absolute path: name a folder).
absl::StatusOr<std::string> DefaultDataFolder();

// The folder in which one server keeps what it has acknowledged. Held by one process at a time, by
// a lock (flock) on a file of its own that goes with the process, however it ends.
//
// A moved-from object holds nothing.
class DataFolder {
 public:
  // Makes the folder (0700, and what is missing above it) or takes the one that is there.
  //
  // Errors are one line that says what to do: FailedPrecondition (others may enter it or it is not
  // ours; a network file system, where neither locks nor SQLite can be trusted; read-only; not a
  // folder), Unavailable (held by another server: which), ResourceExhausted (the disk is full), or
  // what the system says.
  static absl::StatusOr<DataFolder> Open(const std::string& path);

  ~DataFolder();
  DataFolder(DataFolder&& other) noexcept;
  DataFolder& operator=(DataFolder&&) = delete;

  const std::string& path() const { return path_; }
  std::string database() const { return path_ + "/tissueform.db"; }
  std::string blobs() const { return path_ + "/blobs"; }
  std::string uploads() const { return path_ + "/uploads"; }
  std::string damaged() const { return path_ + "/damaged"; }

  // Unavailable when the folder that was opened is missing, or another one is in its place: what is
  // written would be lost with it. Cheap (one system call).
  absl::Status CheckStillThere() const;

 private:
  DataFolder(std::string path, int lock, dev_t device, ino_t inode)
      : path_(std::move(path)), lock_(lock), device_(device), inode_(inode) {}

  std::string path_;
  int lock_;  // descriptor; -1: moved from
  dev_t device_;
  ino_t inode_;
};

// OK for a file system on a disk of this machine; FailedPrecondition for one of a network. `type`
// is statfs's f_type.
absl::Status CheckFileSystem(const std::string& path, int64_t type);

}  // namespace tissueform
