// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/post_operative.h"

#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include <Eigen/LU>

#include "client/cli/shared/stage_progress.h"
#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/ct/patient_axes.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/plan_building/plan_labels.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/resampled_ct.h"
#include "core/planning/plan_building/viewer_surfaces.h"

namespace tissueform {
namespace {

// Finer than a plan's 1.5 mm, at which the error of a prediction is read 0.1 mm too large on lips
// (here 0.05 mm). Not much finer: thin bone looks thicker in coarser voxels, and the plan's bone is
// compared with this one. At 1 mm the Visible Human's lower jaw was found 0.16 mm off, here 0.08.
constexpr double kSpacingMm = 1.2;

absl::StatusOr<TriangleMesh> ReadSurface(const std::string& path, const std::string& axes) {
  if (!CheckAxes(axes).ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--post-axes ", axes,
                     " must be three letters, where x, y and z grow toward: L or R, A or P, "
                     "S or I, each pair once (\"LPS\", \"RAS\")"));
  }
  const Eigen::Matrix3d to_lps = DirectionOf(axes);
  if (to_lps.determinant() < 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--post-axes ", axes, " mirrors the head; name the axes in their order, as LPS or RAS"));
  }
  TF_ASSIGN_OR_RETURN(const TriangleMeshFile file, ReadTriangleMesh(path));
  return TriangleMesh::Create(file.mesh.positions() * to_lps.transpose(), file.mesh.triangles());
}

absl::StatusOr<PostOperativeHead> ReadSurfacesOf(const PostOperativeInput& input) {
  const std::string axes = absl::AsciiStrToUpper(input.axes);
  TF_ASSIGN_OR_RETURN(TriangleMesh skin, ReadSurface(input.scan, axes));
  PostOperativeHead head{.skin = std::move(skin), .bone = {}};
  if (!input.bone.empty()) {
    TF_ASSIGN_OR_RETURN(head.bone, ReadSurface(input.bone, axes));
  }
  return head;
}

absl::StatusOr<Recipe> RecipeOf(const PostOperativeInput& input) {
  Recipe recipe;
  if (!input.recipe.empty()) {
    TF_ASSIGN_OR_RETURN(recipe, ReadRecipe(input.recipe));
  }
  recipe.spacing_mm = kSpacingMm;
  recipe.labels.file = input.labels;
  return recipe;
}

absl::StatusOr<PostOperativeHead> ReadCt(const PostOperativeInput& input) {
  TF_ASSIGN_OR_RETURN(const Recipe given, RecipeOf(input));
  std::optional<StageProgress> progress("reading the post-operative CT");
  TF_ASSIGN_OR_RETURN(ResampledCt scan, ReadResampledCt(input.scan, given, input.threads, [] {}));
  const Recipe recipe = WithThresholds(given, scan.values);
  TF_ASSIGN_OR_RETURN(std::optional<PlanLabels> labels,
                      ReadPlanLabels(recipe, scan.frame_uid, input.threads, &scan.ct.hu));
  progress.emplace("finding head and bone after the operation");
  TF_ASSIGN_OR_RETURN(HeadSegmentation head, SegmentHead(scan.ct.hu, recipe.segmentation, nullptr,
                                                         scan.ct.metal, scan.unscanned));
  if (labels) {
    TF_RETURN_IF_ERROR(
        SeparateByLabels(SeparateBoneParts(head), recipe.tissues, &head, &*labels).status());
  }
  TF_ASSIGN_OR_RETURN(HeadShells shells, MakeHeadShells(head, scan.spacing_mm.maxCoeff()));
  return PostOperativeHead{.skin = std::move(shells.skin), .bone = std::move(shells.bone)};
}

}  // namespace

absl::StatusOr<PostOperativeHead> ReadPostOperative(const PostOperativeInput& input) {
  return NamesSurface(input.scan) ? ReadSurfacesOf(input) : ReadCt(input);
}

}  // namespace tissueform
