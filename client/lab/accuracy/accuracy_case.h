// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/rendering/panels.h"
#include "core/planning/skin_places.h"

namespace tissueform {

// One problem on which all models are compared with the independent finite elements.
struct AccuracyCase {
  std::string name;   // in file names and tables
  std::string title;  // in pictures
  TetMesh mesh;
  Eigen::VectorXd stiffness;  // Pa, #T
  ConstraintSet constraints;
  std::vector<HandlePose> poses;
  std::vector<View> views;                                      // at least one
  std::vector<double> poisson_ratios = {0.0, 0.3, 0.45, 0.49};  // at which it is solved
  std::vector<SkinPlace> places = {};                           // of a head's skin
};

// A bar of 10 x 10 x 30 mm of one material, the lower end fixed. "bar_bend": the upper end turned
// by 30 degrees to where an arc of the bar's length ends. "bar_twist": turned by 45 degrees about
// the bar's axis and drawn out by 15 %. `cells` across; three times as many along.
absl::StatusOr<AccuracyCase> BendCase(int cells);
absl::StatusOr<AccuracyCase> TwistAndStretchCase(int cells);

// The layered block (layered_block.h), its patch moved along and up.
absl::StatusOr<AccuracyCase> BlockAlongCase(const std::array<int, 3>& cells);
absl::StatusOr<AccuracyCase> BlockUpCase(const std::array<int, 3>& cells);

// The problem of a plan file under a name of our own; its Poisson's ratio and model do not count.
// Where the mesh names places of skin, it is a head: seen from the front and from its left, and
// solved at the ratios that one plans with, 0.3 and 0.45.
absl::StatusOr<AccuracyCase> CaseOfPlan(const std::string& name, const std::string& title,
                                        const std::string& plan_path);

}  // namespace tissueform
