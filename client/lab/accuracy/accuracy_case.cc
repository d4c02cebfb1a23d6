// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_case.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "client/lab/accuracy/boundary_surface.h"
#include "client/lab/accuracy/layered_block.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

constexpr double kSideMm = 10;
constexpr double kLengthMm = 30;
constexpr double kBarPa = 15000;
constexpr double kBendRadians = 30 * std::numbers::pi / 180;
constexpr double kTwistRadians = 45 * std::numbers::pi / 180;
constexpr double kStretch = 0.15;

const View kBarView{{0.35, -1.0, 0.25}, {0, 0, 1}};
const View kBlockView{{0.35, -1.0, 0.75}, {0, 0, 1}};
// Tip and back of the bundled tongue lie on opposite sides of y.
const View kTongueView{{1.0, -0.4, 0.35}, {0, 0, 1}};
// LPS: the patient looks along -y, and +x is his left.
const View kFrontView{{0, -1, 0}, {0, 0, 1}};
const View kLeftView{{1, 0, 0}, {0, 0, 1}};

absl::StatusOr<AccuracyCase> BarCase(std::string name, std::string title, int cells,
                                     const HandlePose& pose) {
  TF_ASSIGN_OR_RETURN(TetMesh bar, BarMesh(CubeGrid({cells, cells, 3 * cells}, kSideMm / cells)));
  TF_ASSIGN_OR_RETURN(ConstraintSet ends, ConstrainEnds(bar.positions()));
  Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(bar.num_tets(), kBarPa);
  return AccuracyCase{std::move(name), std::move(title), std::move(bar), std::move(stiffness),
                      std::move(ends), {pose},           {kBarView}};
}

HandlePose AtUpperEnd() {
  HandlePose pose;
  pose.pivot_mm = {kSideMm / 2, kSideMm / 2, kLengthMm};
  return pose;
}

absl::StatusOr<AccuracyCase> BlockCase(std::string name, std::string title,
                                       const std::array<int, 3>& cells, const HandlePose& pose) {
  TF_ASSIGN_OR_RETURN(LayeredBlock block, MakeLayeredBlock(cells));
  return AccuracyCase{std::move(name),
                      std::move(title),
                      std::move(block.mesh),
                      std::move(block.stiffness),
                      std::move(block.constraints),
                      {pose},
                      {kBlockView}};
}

}  // namespace

absl::StatusOr<AccuracyCase> BendCase(int cells) {
  // Of the arc into which the bar would bend at its own length: the end goes where that arc ends,
  // so that the case is bending and not stretching.
  constexpr double kRadius = kLengthMm / kBendRadians;
  HandlePose pose = AtUpperEnd();
  pose.rotation_vector.y() = kBendRadians;
  pose.translation_mm = {kRadius * (1 - std::cos(kBendRadians)), 0,
                         kRadius * std::sin(kBendRadians) - kLengthMm};
  return BarCase("bar_bend", "bar, one end turned by 30\u00b0 along an arc", cells, pose);
}

absl::StatusOr<AccuracyCase> TwistAndStretchCase(int cells) {
  HandlePose pose = AtUpperEnd();
  pose.rotation_vector.z() = kTwistRadians;
  pose.translation_mm.z() = kStretch * kLengthMm;
  return BarCase("bar_twist", "bar, one end twisted by 45\u00b0 and drawn out by 15 %", cells,
                 pose);
}

absl::StatusOr<AccuracyCase> BlockAlongCase(const std::array<int, 3>& cells) {
  return BlockCase("block_along", "layered block, patch of the bottom moved 5 mm along", cells,
                   MoveAlong());
}

absl::StatusOr<AccuracyCase> BlockUpCase(const std::array<int, 3>& cells) {
  return BlockCase("block_up", "layered block, patch of the bottom moved 5 mm up", cells, MoveUp());
}

absl::StatusOr<AccuracyCase> CaseOfPlan(const std::string& name, const std::string& title,
                                        const std::string& plan_path) {
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(plan_path));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan));
  AccuracyCase result{name,
                      title,
                      *problem.mesh,
                      std::move(problem.stiffness),
                      std::move(problem.constraints),
                      std::move(problem.poses),
                      {kTongueView}};
  TF_ASSIGN_OR_RETURN(result.places, SkinPlaces(problem.point_data));
  if (!result.places.empty()) {
    result.views = {kFrontView, kLeftView};
    result.poisson_ratios = {0.3, 0.45};
  }
  return result;
}

}  // namespace tissueform
