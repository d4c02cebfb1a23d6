// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/imaging/anatomy/tet_stiffness.h"
#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/gray_values.h"
#include "core/imaging/metal/metal_reduction.h"
#include "core/mechanics/constraints/head_frame.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/plan_building/frankfort.h"
#include "core/planning/plan_building/lip_parting.h"
#include "core/planning/plan_building/plan_labels.h"
#include "core/planning/plan_building/planning_regions.h"
#include "core/planning/plan_building/recipe.h"
#include "core/planning/plan_building/skin_coverage.h"
#include "core/planning/plan_building/skin_distance.h"
#include "core/planning/plan_building/soft_tissue_mesh.h"

namespace tissueform {

// More than any jaw is moved: what is above comes from a slip in the recipe.
inline constexpr double kMaxMoveMm = 50;

// A piece of bone that moves.
struct BuiltSegment {
  OsteotomySegment cut;  // with the planes that were used
  HandlePose pose;
  double largest_move_mm = 0;  // of the voxel that the pose moves farthest; at most kMaxMoveMm
  double volume_mm3 = 0;
  TriangleMesh surface;  // closed, LPS
};

std::vector<std::string> NamesOf(const std::vector<BuiltSegment>& segments);

// A planning model with all that led to it: what is written, reported and drawn. BuildPlan makes it
// whole, at the end, from what its stages return; it always has its mesh.
struct PlanBuild {
  Recipe recipe;
  CtProvenance ct;
  std::vector<std::string> surface_roles = {};  // of a plan from surfaces alone; empty: from a CT
  CtValuesReport values = {};
  std::array<int, 3> ct_size = {0, 0, 0};
  Eigen::Vector3d ct_spacing_mm = Eigen::Vector3d::Zero();
  MetalReport metal;
  LabelGrid carried_skin = {};  // CtWithMetal::carried_skin
  HuGrid before_correction;     // the resampled CT about the metal before its streaks were reduced
  HeadSegmentation head;        // its geometry is the resampled CT's
  BoneParts parts;
  LabelGrid bone;  // 0 none, 1 stays, 2.. the segments; on the head's grid
  Landmarks landmarks;
  std::vector<BuiltSegment> segments;
  SoftTissue soft_tissue;
  double contact_band_mm = 0;
  SoftTissueMesh mesh;  // with the doubles of parted lips last, which its surface has not
  TetStiffness stiffness;
  PlanningRegions regions;
  int64_t num_released_by_trial = 0;  // of regions.freed_by_contact, by ReleaseTornContacts
  int64_t num_inverted = 0;           // tets that it could not keep from turning inside out
  SkinDistance skin_distance;
  SkinCoverage coverage;
  std::optional<PlanLabels> labels = {};  // where the recipe names a label map
  // Where the regions of the lips meet, and where the lips part; an error where the CT shows none.
  absl::StatusOr<MouthLine> mouth = absl::UnknownError("not looked for");
  std::optional<PartedLips> lips = {};               // where the recipe parts them
  std::optional<FrankfortLandmarks> frankfort = {};  // where they were found
  HeadFrame head_frame = {};
  std::vector<CaseSurface> viewer_surfaces = {};
};

struct PlanBuildOptions {
  int threads = 1;  // the plan does not depend on it
  // Called with what begins and how much of the whole is done, in [0, 1], rising.
  StageFunction on_stage;
};

// From a CT to a planning model, by the recipe.
//
// Errors: those of the stages (core/imaging/ct, core/imaging/anatomy, core/mesh/generation), each
// of which says what it found and what to do.
absl::StatusOr<PlanBuild> BuildPlan(const std::string& ct_path, const Recipe& recipe,
                                    const PlanBuildOptions& options = {});

// The same from a surfaces file (surfaces_file.h), without a CT: the grids of the result are made
// from the surfaces, and its recipe is what the file says besides.
//
// Errors: those of ReadSurfaces and MakeHeadFromSurfaces, and those of the later stages.
absl::StatusOr<PlanBuild> BuildPlanFromSurfaces(const std::string& path,
                                                const PlanBuildOptions& options = {});
// How far the recipe's label map and our own segmentation agree, without a plan. Errors: those of
// BuildPlan up to the separation of the jaws; InvalidArgument where the recipe has no label map.
absl::StatusOr<PlanLabels> CompareWithLabels(const std::string& ct_path, const Recipe& recipe,
                                             const PlanBuildOptions& options = {});

// Writes into the folder, which exists:
//   plan.json           the plan (docs/plan-format.md)
//   head.vtu            the mesh; point arrays anatomy, skin_region, contact where the lips are
//                       parted (the bits of lip_parting.h); cell arrays mean_hu, voxels,
//                       tissue, youngs_modulus_pa
//   segments/NAME.stl   the pieces of bone
//   viewer.glb          what a viewer needs besides (core/planning/case_file/viewer_file.h)
// The same build gives the same bytes. Errors: those of writing files.
absl::Status WritePlan(const PlanBuild& build, const std::string& folder);

// What ReadPlan and ResolvePlan make of these files, without the files: for deformers and sessions.
// Equal to the last bit: positions, tets, arrays, stiffness, regions, poses. Errors: those of
// ResolvePlan.
absl::StatusOr<PlanProblem> ToPlanProblem(const PlanBuild& build);

}  // namespace tissueform
