// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "core/base/archive/zip_limits.h"

namespace tissueform {

// Whether a path names a zip: a file whose name ends with .zip, or that begins as zips do.
bool IsZip(const std::string& path);

// The files of a zip in a private folder, which goes with this object. A helper program unpacks
// them: libzip is in no other program.
class UnpackedZip {
 public:
  // Makes the folder in `parent`, which exists. Nothing is left after an error.
  //
  // Errors: InvalidArgument for what is not a zip, is damaged or empty; for entries that are
  // encrypted, zips themselves, links or devices, or have names that lead out of the folder;
  // ResourceExhausted beyond a limit or when the disk is full; those of CallHelper. Messages name
  // entries by their number, because names may hold a patient's.
  static absl::StatusOr<UnpackedZip> Unpack(const std::string& path, const std::string& parent,
                                            const ZipLimits& limits = {});
  ~UnpackedZip();
  UnpackedZip(UnpackedZip&& other) noexcept;
  UnpackedZip& operator=(UnpackedZip&&) = delete;

  const std::string& folder() const { return folder_; }

 private:
  explicit UnpackedZip(std::string folder) : folder_(std::move(folder)) {}

  std::string folder_;  // empty: moved from
};

// Inside the helper program: main() returns this. `unpack` fills the folder.
int RunUnzip(const std::function<absl::Status(const std::string& path, const std::string& folder,
                                              const ZipLimits& limits)>& unpack);

}  // namespace tissueform
