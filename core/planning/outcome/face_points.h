// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/viewer_file.h"

namespace tissueform {

// A landmark of the skin as material: it moves by the weighted sum of displacements of the tet
// mesh's vertices.
struct FacePoint {
  std::string name;  // as in docs/measures.md; also "stomion" (of the upper lip) and "cheilion"
  std::vector<std::pair<int32_t, double>> weights;  // vertex, weight
};

// The skin landmarks of a head: those of its viewer file, stomion and sublabiale where the profile
// of the skin has them, and cheilion (both corners of the mouth, averaged) where lips are parted.
// `problem` may have contact or not; the points are then the same, for vertices keep their numbers
// when lips are joined. `rows` are the plan's rows of contact with it, or empty.
std::vector<FacePoint> FacePointsOf(const PlanProblem& problem, const ViewerFile& viewer,
                                    const std::vector<ContactRow>& rows);

// The movement of a point, mm; `displacements` of the tet mesh, #V by 3.
Eigen::Vector3d MovementOf(const FacePoint& point, const Positions& displacements);

// How far skin moves for each mm of its bone: its part along the bone's movement over the length of
// that. REQUIRES: the bone moves.
double MovementRatio(const Eigen::Vector3d& skin_mm, const Eigen::Vector3d& bone_mm);

}  // namespace tissueform
