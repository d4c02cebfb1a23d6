// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/test_paths.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

fs::path ProgramFolder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

// What CMake wrote down about the source tree; empty when the program has been taken out of its
// build folder.
std::string SourceTreeOfBuild(const fs::path& build) {
  const std::string key = "CMAKE_HOME_DIRECTORY:INTERNAL=";
  std::ifstream cache(build / "CMakeCache.txt");
  for (std::string line; std::getline(cache, line);) {
    if (line.rfind(key, 0) == 0) return line.substr(key.size());
  }
  return "";
}

std::string FindSourceTree() {
  if (const char* tree = std::getenv("TISSUEFORM_SOURCE_DIR")) return tree;
  std::string tree = SourceTreeOfBuild(ProgramFolder().parent_path());
  if (tree.empty()) {
    std::fputs("where is the source tree? Run the tests with ctest, or set TISSUEFORM_SOURCE_DIR\n",
               stderr);
    std::exit(2);
  }
  return tree;
}

}  // namespace

std::string SourcePath(const std::string& path_in_source_tree) {
  static const std::string* const kTree = new std::string(FindSourceTree());
  return *kTree + "/" + path_in_source_tree;
}

std::string ProgramPath(const std::string& name) { return ProgramFolder() / name; }

}  // namespace tissueform::testing
