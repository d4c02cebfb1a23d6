// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_io.h"

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh_io/tet_mesh_io.h"

namespace tissueform {
namespace {

absl::Status CheckPlanFile(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat("plan file ", path, " does not exist"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(
        absl::StrCat("plan ", path, ": it is a folder or a device; name a .json file"));
  }
  return absl::OkStatus();
}

// Reads one byte more than allowed at most, whatever the size of the file was a moment ago.
absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text;
  std::string block(size_t{1} << 16, '\0');
  while (stream && text.size() <= kMaxPlanBytes) {
    stream.read(block.data(), static_cast<std::streamsize>(block.size()));
    text.append(block, 0, static_cast<size_t>(stream.gcount()));
  }
  if (text.size() > kMaxPlanBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("plan ", path, " has more than ", kMaxPlanBytes, " bytes; that is no plan"));
  }
  if (!stream.eof()) {
    return absl::PermissionDeniedError(
        absl::StrCat("cannot read plan ", path, "; check its permissions"));
  }
  return text;
}

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
    return absl::PermissionDeniedError(absl::StrCat(
        "plan ", plan_path, ": its mesh ", file,
        " lies outside the folder of the plan; put it there, or allow it (--allow-outside)"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Plan> ReadPlan(const std::string& path, const PlanReadOptions& options) {
  TF_RETURN_IF_ERROR(CheckPlanFile(path));
  TF_ASSIGN_OR_RETURN(const std::string text, ReadText(path));
  TF_ASSIGN_OR_RETURN(Plan plan,
                      ParsePlan(text, std::filesystem::path(path).parent_path().string(), path));
  if (!options.allow_outside) TF_RETURN_IF_ERROR(CheckInside(path, plan));
  return plan;
}

}  // namespace tissueform
