// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// OK when an AtomicFolder can be made: `folder` is empty or not there yet, is not the current
// folder, and lies in a folder in which this process may write. Asked before long work.
//
// Errors: AlreadyExists (it holds something, or is a file), NotFound (no folder around it),
// FailedPrecondition (the current folder), PermissionDenied.
absl::Status CheckFillable(const std::string& folder);

// A folder that appears at once, with all that it holds, or not at all. It is filled under another
// name next to its destination, in a hidden folder that only its owner may enter
// (.NAME.partial-XXXXXX/NAME). An unpublished folder is removed with this object; writers must have
// ended by then.
class AtomicFolder {
 public:
  // Errors: those of CheckFillable, or what the system says.
  static absl::StatusOr<AtomicFolder> Create(const std::string& folder);
  ~AtomicFolder();
  AtomicFolder(AtomicFolder&& other) noexcept;
  AtomicFolder& operator=(AtomicFolder&&) = delete;

  // Where to write until it is published.
  const std::string& path() const { return path_; }

  // Gives it its name, once. Errors leave the content to the destructor: FailedPrecondition when
  // another writer has filled the destination since then, or the system's error.
  absl::Status Publish();

 private:
  AtomicFolder(std::string goal, std::string hidden, std::string path);

  std::string goal_;
  std::string hidden_;  // the folder round `path_`; empty: moved from
  std::string path_;
};

}  // namespace tissueform
