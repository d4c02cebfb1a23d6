// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/cli/compare/comparison_report.h"
#include "core/base/types.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// Vertices of the boundary that are neither fixed nor moved with a bone, rising: the skin, and what
// lines the mouth and the airway.
std::vector<int32_t> FreeSkin(const PlanProblem& problem);

// The named places of a face that the mesh has, in words for people: chin, lower lip, upper lip,
// nose, left cheek, right cheek. Empty for a mesh that has none. Errors: those of SkinPlaces.
absl::StatusOr<std::vector<ComparedRegion>> FaceRegions(const PlanProblem& problem);

// How far skin goes, and how far of that to the front (-y of LPS), in mm.
struct Movement {
  double total_mm = 0;
  double forward_mm = 0;
};

struct RegionMovement {
  std::string name;
  int64_t vertices = 0;
  Movement foremost;  // of the vertex that lies farthest to the front at rest: the tip of the nose
  Movement mean;      // over all vertices of the region
};

// How the regions go from `rest` to `deformed` (#V by 3 each, LPS). REQUIRES: no region is empty.
std::vector<RegionMovement> MeasureMovement(const std::vector<ComparedRegion>& regions,
                                            const Positions& rest, const Positions& deformed);

}  // namespace tissueform
