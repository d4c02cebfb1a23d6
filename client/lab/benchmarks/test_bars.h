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

namespace tissueform::benchmarks {

// Cells along x, y, z of what is measured, 1 mm each: the five bars of the source's Table 1 (Liao
// et al. 2009), then one of 262,701 vertices and 1.5 million tets. Bar numbers count from one.
inline constexpr std::array<std::array<int, 3>, 6> kBars = {
    {{10, 10, 20}, {10, 10, 60}, {15, 25, 30}, {20, 20, 50}, {25, 25, 50}, {50, 50, 100}}};
// The last of Table 1, with 34,476 vertices: where ratios are asked for.
inline constexpr int kPaperBar = 5;
inline constexpr int kLargeBar = 6;

// A bar of unit stiffness along z, its lowest layer fixed, its highest one the handle "end".
struct TestBar {
  int number = 0;
  std::string name;  // "25x25x50"
  TetMesh mesh;
  Eigen::VectorXd stiffness;
  ConstraintSet ends;
};

// REQUIRES: 1 <= number <= 6.
absl::StatusOr<TestBar> MakeTestBar(int number);

// What the `estimated` mode is for: the handle goes sideways by a third of the bar's length and
// does not turn (Liao et al. 2009, Figs. 3 and 4).
std::vector<HandlePose> SidewaysPose(const TestBar& bar);

// One thousandth of that way, in mm.
double SidewaysTolerance(const TestBar& bar);

}  // namespace tissueform::benchmarks
