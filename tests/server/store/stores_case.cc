// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/stores_case.h"

#include <cstdlib>
#include <filesystem>
#include <utility>

#include "gtest/gtest.h"

#include "server/store/in_memory_stores.h"

namespace tissueform {

ScratchFolder::ScratchFolder() : path_(::testing::TempDir() + "store-XXXXXX") {
  if (mkdtemp(path_.data()) == nullptr) std::abort();
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<StoresCase> AllStores() {
  return {{"InMemory", [](UnixClock clock) { return *OpenInMemoryStores(std::move(clock)); }}};
}

}  // namespace tissueform
