// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"

#include "client/cli/shared/total_band.h"
#include "client/cli/shared/uncertainty_results.h"
#include "core/base/types.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/plan.h"

namespace tissueform {

// Name of the point array that every result holds.
inline constexpr char kDisplacementArray[] = "displacement_mm";
// Cell array of every result: the three principal Green-Lagrange strains of each tet, the largest
// first.
inline constexpr char kPrincipalStrainArray[] = "principal_strain";
// Of lips that were asked to be sealed, on vertices: 1 at the upper lip's edge, 2 at the lower
// lip's, which is held; 3 at both where the lips were released.
inline constexpr char kLipSealArray[] = "lip_seal";

// The bands of a result. A null pointer: the result does not have that band.
struct ResultBands {
  const MaterialBand* material = nullptr;
  const TotalBand* total = nullptr;
};

// Writes OUT.vtu: the plan's mesh with its points at `deformed` (#V by 3, LPS), written in the
// plan's own coordinate system; a point array displacement_mm of three doubles; the cell array
// principal_strain; of the elastic models those of elastic_results.h, and those of
// uncertainty_results.h and total_band.h where there are `bands`; all arrays of the plan's mesh,
// except that arrays of these names are replaced, and that kContactArray of the mesh is 0
// everywhere where contact was left out.
//
// Errors: FailedPrecondition when `path` is the plan's own mesh; Internal when a position is not
// finite; those of WriteTetMesh.
absl::Status WriteResult(const std::string& path, const Plan& plan, const PlanProblem& problem,
                         const Positions& deformed, const ResultBands& bands = {},
                         const std::optional<SealAnswer>& seal = std::nullopt);

}  // namespace tissueform
