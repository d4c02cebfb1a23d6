// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/plain_names.h"

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"

namespace tissueform {

absl::StatusOr<PlainNames> PlainNames::Create() {
  std::error_code error;
  const std::filesystem::path place = std::filesystem::temp_directory_path(error);
  std::string folder = (place / "tissueform-XXXXXX").string();
  if (error || mkdtemp(folder.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot create a temporary folder in ",
                                                   place.string(), "; set TMPDIR"));
  }
  return PlainNames(std::move(folder));
}

PlainNames::PlainNames(std::string folder) : folder_(std::move(folder)) {}

PlainNames::PlainNames(PlainNames&& other) noexcept
    : folder_(std::exchange(other.folder_, std::string())) {}

PlainNames::~PlainNames() {
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

absl::Status PlainNames::Link(const std::string& target, absl::string_view name) const {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(target, error);
  if (!error) std::filesystem::create_symlink(absolute, Path(name), error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("cannot link ", target, ": ", error.message()));
}

absl::Status PlainNames::Write(absl::string_view name, absl::string_view contents) const {
  return WriteFileAtomically(Path(name), contents);
}

std::string PlainNames::Path(absl::string_view name) const {
  return absl::StrCat(folder_, "/", name);
}

}  // namespace tissueform
