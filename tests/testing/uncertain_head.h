// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/tet_topology.h"
#include "core/planning/plan_io.h"
#include "tests/testing/handle_problem.h"

namespace tissueform::testing {

// The head with three segments, with all that may be unknown of a material.
inline PlanProblem UncertainHead() {
  Plan plan = *ReadPlan(TestDataPath("plans/three_segments/plan.json"));
  plan.uncertainty.emplace().youngs_modulus_factor_95 = 2.0;
  plan.uncertainty->poisson_ratio_95 = {0.4, 0.48};
  return *ResolvePlan(plan);
}

// A third of the skin's vertices: about as many as what is drawn follows.
inline std::vector<int32_t> SomeSkin(const TetMesh& mesh) {
  std::vector<int32_t> some;
  const std::vector<int32_t> skin = BoundaryVertices(mesh);
  for (size_t v = 0; v < skin.size(); v += 3) some.push_back(skin[v]);
  return some;
}

// How far operations move bone.
inline constexpr double kOperationMm = 10;
inline constexpr double kOperationRad = 0.14;  // 8 degrees

// Of every handle: turned about its middle and moved, by up to `part` of what operations do.
inline std::vector<HandlePose> OperationPoses(const TetMesh& mesh, const ConstraintSet& constraints,
                                              double part, RandomNumbers* random) {
  std::vector<HandlePose> poses;
  for (const HandleRegion& handle : constraints.handles()) {
    HandlePose& pose = poses.emplace_back();
    pose.pivot_mm = mesh.positions()(handle.vertices, Eigen::all).colwise().mean();
    pose.rotation_vector = part * kOperationRad * random->Next() * random->Vector().normalized();
    pose.translation_mm = part * kOperationMm * random->Next() * random->Vector().normalized();
  }
  return poses;
}

}  // namespace tissueform::testing
