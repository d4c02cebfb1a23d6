// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

namespace tissueform::testing {

// Where members of a .tar.xz are unpacked; gone at the end of the test.
class UnpackedArchive {
 public:
  // `members` are patterns in quotes of the shell.
  explicit UnpackedArchive(const std::string& archive, const std::string& members)
      : folder_(std::filesystem::path(::testing::TempDir()) / absl::StrCat("unpacked_", getpid())) {
    std::filesystem::create_directories(folder_);
    const std::string command =
        absl::StrCat("tar -xJf '", archive, "' -C '", folder_.string(), "' --wildcards ", members);
    ok_ = std::system(command.c_str()) == 0;
  }
  ~UnpackedArchive() { std::filesystem::remove_all(folder_); }
  UnpackedArchive(const UnpackedArchive&) = delete;
  UnpackedArchive& operator=(const UnpackedArchive&) = delete;

  bool ok() const { return ok_; }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

 private:
  std::filesystem::path folder_;
  bool ok_ = false;
};

}  // namespace tissueform::testing
