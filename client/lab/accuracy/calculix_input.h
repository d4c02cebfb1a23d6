// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

enum class CalculixLaw {
  kLinear,      // small strains, one step
  kNeoHookean,  // *HYPERELASTIC, NEO HOOKE with NLGEOM, loaded in increments
};

// Tets of constant strain whose constrained vertices are displaced, all others free of forces.
struct CalculixProblem {
  TetMesh mesh;
  Eigen::VectorXd stiffness;  // Young's modulus, Pa, #T
  double poisson_ratio = 0.45;
  ConstraintSet constraints;
  Positions displacements;  // of constraints.constrained(), as many rows, mm
  CalculixLaw law = CalculixLaw::kLinear;
  // Print also what holds every vertex (RF) and the stresses of the tets (S, Cauchy's).
  bool forces_and_stresses = false;
};

// Where the poses take the constrained vertices, minus where these rest: #constrained by 3, mm.
//
// REQUIRES: one legal pose per handle.
Positions ConstrainedDisplacements(const TetMesh& mesh, const ConstraintSet& constraints,
                                   absl::Span<const HandlePose> poses);

// The problem as an input file of CalculiX (.inp): C3D4 elements, one material for each distinct
// stiffness, mm and Pa (so forces are in Pa mm^2), displacements of all vertices printed at the
// end.
//
// NEO HOOKE with C10 = E / (4 (1 + nu)) and D1 = 6 (1 - 2 nu) / E is
// W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2 with mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)).
//
// Numbers have 13 digits: CalculiX reads the first 20 characters of a field and no more.
std::string CalculixInput(const CalculixProblem& problem);

}  // namespace tissueform
