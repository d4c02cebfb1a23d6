// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/json_file.h"

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status CheckIsFile(const std::string& path, absl::string_view what) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(what, " file ", path, " does not exist"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(
        absl::StrCat(what, " ", path, ": it is a folder or a device; name a .json file"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> ReadJsonText(const std::string& path, absl::string_view what,
                                         size_t most_bytes) {
  TF_RETURN_IF_ERROR(CheckIsFile(path, what));
  std::ifstream stream(path, std::ios::binary);
  std::string text;
  std::string block(size_t{1} << 16, '\0');
  while (stream && text.size() <= most_bytes) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block, 0, static_cast<size_t>(stream.gcount()));
  }
  if (text.size() > most_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(what, " ", path, " has more than ", most_bytes, " bytes; that is no ", what));
  }
  if (!stream.eof()) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot read ", what, " ", path, "; check its permissions"));
  }
  return text;
}

}  // namespace tissueform
