// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/archive/zip_names.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr size_t kMaxNameBytes = 4096;
constexpr size_t kMaxPartBytes = 255;  // of file systems

bool IsAbsolute(absl::string_view name) {
  const bool has_drive = name.size() >= 2 &&
                         absl::ascii_isalpha(static_cast<unsigned char>(name[0])) && name[1] == ':';
  return absl::StartsWith(name, "/") || absl::StartsWith(name, "\\") || has_drive;
}

bool HasControl(absl::string_view name) {
  return std::any_of(name.begin(), name.end(), [](char letter) {
    return absl::ascii_iscntrl(static_cast<unsigned char>(letter));
  });
}

}  // namespace

absl::StatusOr<std::vector<std::string>> PartsOfZipName(absl::string_view name,
                                                        int max_folder_depth) {
  if (name.empty() || name.size() > kMaxNameBytes || HasControl(name)) {
    return absl::InvalidArgumentError("has a name that is empty, too long or not text");
  }
  if (IsAbsolute(name)) return absl::InvalidArgumentError("has an absolute path as its name");
  std::vector<std::string> parts;
  for (const absl::string_view part : absl::StrSplit(name, absl::ByAnyChar("/\\"))) {
    if (part == "..") {
      return absl::InvalidArgumentError("has a name with \"..\", which leads out of the folder");
    }
    if (part.size() > kMaxPartBytes) return absl::InvalidArgumentError("has too long a name");
    if (!part.empty() && part != ".") parts.emplace_back(part);
  }
  if (static_cast<int>(parts.size()) > max_folder_depth) {
    return absl::InvalidArgumentError(
        absl::StrCat("is in more than ", max_folder_depth, " folders"));
  }
  return parts;
}

bool IsSystemClutter(const std::vector<std::string>& parts) {
  if (parts.empty()) return false;
  const std::string& name = parts.back();
  return parts.front() == "__MACOSX" || name == ".DS_Store" || name == "Thumbs.db" ||
         absl::StartsWith(name, "._");
}

}  // namespace tissueform
