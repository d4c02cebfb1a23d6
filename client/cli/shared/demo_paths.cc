// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/demo_paths.h"

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"

#include "core/base/process/child_process.h"

namespace tissueform {

namespace fs = std::filesystem;

absl::StatusOr<std::string> FindBundledPlan(const std::string& name) {
  const fs::path plan =
      fs::path(ProgramFolder()).parent_path() / "share/tissueform/plans" / name / "plan.json";
  std::error_code error;
  if (fs::is_regular_file(plan, error)) return plan.string();
  return absl::NotFoundError(absl::StrCat("the bundled plan \"", name,
                                          "\" is not at its installed path (", plan.string(), ")"));
}

absl::StatusOr<std::string> FindDemoPlan(const std::string& chosen) {
  if (!chosen.empty()) {
    return chosen;
  }
  const absl::StatusOr<std::string> head = FindBundledPlan("head");
  if (head.ok()) return head;
  return absl::NotFoundError(
      absl::StrCat(absl::string_view(head.status().message()), "; pass a plan with --plan"));
}

}  // namespace tissueform
