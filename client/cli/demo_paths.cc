// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/demo_paths.h"

#include <filesystem>
#include <system_error>

namespace tissueform {
namespace {

namespace fs = std::filesystem;

fs::path ProgramFolder() {
  std::error_code error;
  return fs::read_symlink("/proc/self/exe", error).parent_path();
}

}  // namespace

std::string SiblingProgram(const std::string& name) { return (ProgramFolder() / name).string(); }

absl::StatusOr<std::string> FindDemoPlan(const std::string& chosen) {
  if (!chosen.empty()) {
    return chosen;
  }
  const fs::path source_tree = TISSUEFORM_SOURCE_DIR;
  for (const fs::path& plan : {ProgramFolder().parent_path() / "share/tissueform/demo/plan.json",
                               source_tree / "tests/data/plans/tongue/plan.json"}) {
    std::error_code error;
    if (fs::is_regular_file(plan, error)) {
      return plan.string();
    }
  }
  return absl::NotFoundError(
      "the bundled plan is neither installed nor in the source tree; give one with --plan");
}

}  // namespace tissueform
