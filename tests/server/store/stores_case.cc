// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/stores_case.h"

#include <cstdlib>
#include <filesystem>

#include "gtest/gtest.h"

namespace tissueform {

ScratchFolder::ScratchFolder() : ScratchFolder("") {}

ScratchFolder::ScratchFolder(const std::string& parent)
    : path_((std::filesystem::is_directory(parent) ? parent + "/" : ::testing::TempDir()) +
            "store-XXXXXX") {
  if (mkdtemp(path_.data()) == nullptr) std::abort();
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace tissueform
