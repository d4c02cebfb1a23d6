// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/plan_building/planning_regions.h"

namespace tissueform {

// What is deformed on trial.
struct TrialSolve {
  const TetMesh& mesh;
  const std::vector<double>& youngs_modulus_pa;  // #T
  double poisson_ratio = 0.45;
  std::vector<HandlePose> poses;  // of segments 2.., as planned
  int threads = 1;                // the outcome does not depend on it
};

struct ContactRelaxation {
  PlanningRegions regions;
  int64_t freed = 0;  // of regions.freed_by_contact, by the trial
  int64_t num_inverted =
      0;  // tets that the last round found inverted, and nothing could be freed for
};

// Widens the contact band where it is too narrow for the planned moves: deforms the mesh as planned
// and by a third more, with gradient_field, linear_elastic and arap (neo_hookean never inverts a
// tet), frees of the constrained vertices of inverted tets so few that each loses one, and again,
// until no tet is inverted or after some rounds. For an inverted tet without constrained vertices
// the nearest ones are freed; but where gradient_field by a third more comes to such a tet, all is
// repeated with it as planned only. This releases narrow places (the gap between teeth, the walls
// of a cut) where necessary, and holds them elsewhere. Nothing is tried where nothing moves.
//
// Returns the regions with those vertices freed. Errors: InvalidArgument when too little of a
// segment or of the fixed bone would be left to hold it.
absl::StatusOr<ContactRelaxation> ReleaseTornContacts(const TrialSolve& trial,
                                                      PlanningRegions regions);

}  // namespace tissueform
