// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/whole_file.h"

#include <filesystem>
#include <fstream>

namespace tissueform {

absl::StatusOr<std::string> ReadWholeFile(const std::string& path, int64_t* bytes_left) {
  std::error_code error;
  const auto bytes = std::filesystem::is_regular_file(path, error)
                         ? static_cast<int64_t>(std::filesystem::file_size(path, error))
                         : int64_t{-1};
  if (error || bytes < 0) {
    return absl::InvalidArgumentError("the file, or the data file beside it, cannot be opened");
  }
  if (bytes > *bytes_left) {
    return absl::ResourceExhaustedError("its files are larger than the limit on their bytes");
  }
  *bytes_left -= bytes;
  std::string contents(static_cast<size_t>(bytes), '\0');
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(contents.data(), bytes)) {
    return absl::InvalidArgumentError("a file cannot be read, or became shorter meanwhile");
  }
  return contents;
}

}  // namespace tissueform
