// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/planning/plan_building/plan_builder.h"

// Two plans of one head by one recipe: what metal in the CT has changed.
namespace tissueform::testing {

// BSSRO, 6 mm forward, all else by default; with the key `metal` as "auto" or "off".
Recipe MetalRecipe(bool correct);

// A number and where in the patient it is worst.
struct WorstAt {
  double mm = 0;
  Eigen::Vector3d place_mm = Eigen::Vector3d::Zero();
  std::string name;  // of a landmark
};

struct PlanDifference {
  // Between the surfaces of the first segment, from the vertices of each to the other.
  double segment_mean_mm = 0;
  double segment_p95_mm = 0;
  WorstAt segment;

  WorstAt landmark;

  // Vertices on bone within kNearSkinMm of the outer skin of the CT without metal where the other
  // plan's bone lies deeper than that all round, and the one with the least skin over it.
  int64_t bone_near_skin = 0;
  WorstAt nearest_bone;

  // Of the skin of the CT without metal, the share that the mesh has: the least of the whole and of
  // its regions.
  double least_covered = 1;
  std::string least_covered_region;

  // Between the predicted movements of the outer skin of lips and chin.
  double movement_mean_mm = 0;
  WorstAt movement;
};

inline constexpr double kNearSkinMm = 2.5;

// The landmark that lies farthest from where `truth` has it.
WorstAt WorstLandmark(const Landmarks& plan, const Landmarks& truth);

// What `plan` has otherwise than `truth`; movements by the given model.
//
// Errors: those of ToPlanProblem and of deformers.
absl::StatusOr<PlanDifference> ComparePlans(const PlanBuild& plan, const PlanBuild& truth,
                                            DeformationModel model);

// A row of a table in Markdown: name | segment mean, 95 % | landmark | bone near skin | covered |
// movement.
std::string TableHead();
std::string TableRow(const std::string& name, const PlanDifference& difference);

}  // namespace tissueform::testing
