// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

namespace tissueform {

// For CalculiX's files, some of which are large; goes with its end.
class CalculixFolder {
 public:
  explicit CalculixFolder(std::string path) : path_(std::move(path)) {
    std::error_code ignored;  // the first file that cannot be written reports the reason
    std::filesystem::create_directories(path_, ignored);
  }
  ~CalculixFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  CalculixFolder(const CalculixFolder&) = delete;
  CalculixFolder& operator=(const CalculixFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

}  // namespace tissueform
