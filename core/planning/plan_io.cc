// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_io.h"

#include <filesystem>

#include "absl/strings/str_cat.h"

#include "core/base/json/json_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

// Where `path` really lies, with every link followed as far as there are files.
std::filesystem::path RealPath(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  std::filesystem::path real = std::filesystem::weakly_canonical(absolute, error);
  return error ? absolute.lexically_normal() : real;
}

// Both ends are followed: a folder of plans may itself be a link, and then what lies in it still
// lies below. By parts of the path, not by text: /data/a is not below /data/ab.
bool LiesBelow(const std::filesystem::path& path, const std::filesystem::path& folder) {
  const std::filesystem::path relative = RealPath(path).lexically_relative(RealPath(folder));
  return !relative.empty() && *relative.begin() != "..";
}

// FilesOfTetMesh, because TetGen's formats are pairs: a plan that names mesh.node here could reach
// mesh.ele elsewhere by a link.
absl::Status CheckInside(const std::string& plan_path, const Plan& plan) {
  const std::filesystem::path folder = std::filesystem::path(plan_path).parent_path();
  for (const std::string& file : FilesOfTetMesh(plan.mesh_path)) {
    if (LiesBelow(file, folder.empty() ? "." : folder)) continue;
    return absl::PermissionDeniedError(
        absl::StrCat("plan ", plan_path, ": its mesh ", file,
                     " is outside the plan's folder; move it there, or pass --allow-outside"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Plan> ReadPlan(const std::string& path, const PlanReadOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(path, "plan", kMaxPlanBytes));
  TF_ASSIGN_OR_RETURN(Plan plan,
                      ParsePlan(text, std::filesystem::path(path).parent_path().string(), path));
  if (!options.allow_outside) TF_RETURN_IF_ERROR(CheckInside(path, plan));
  return plan;
}

}  // namespace tissueform
