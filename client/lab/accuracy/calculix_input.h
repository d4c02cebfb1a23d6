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

// Pa mm: a million times as stiff as the tissue around a vertex, some 1e4 Pa mm.
inline constexpr double kGapSpring = 1e10;
// Gap elements work in steps with finite strains only. Where strains are to be small all motions
// are multiplied by this, and what CalculixResult says is divided by it.
inline constexpr double kSmallMotion = 1e-5;

enum class CalculixLaw {
  kLinear,      // small strains, one step
  kNeoHookean,  // *HYPERELASTIC, NEO HOOKE with NLGEOM, loaded in increments
};

enum class CalculixContact {
  kGapElements,  // the same rows as ours
  // A contact pair, surface to surface, of the faces between the vertices and the others of rows
  // between two lips: CalculiX finds its own rows.
  kSurfaces,
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
  // How far the bone of every contact row moves along the row's normal, in mm; 0 between two lips.
  Eigen::VectorXd bone_motions = {};
  CalculixContact contact = CalculixContact::kGapElements;
};

// Where the poses take the constrained vertices, minus where these rest: #constrained by 3, mm.
//
// REQUIRES: one legal pose per handle.
Positions ConstrainedDisplacements(const TetMesh& mesh, const ConstraintSet& constraints,
                                   absl::Span<const HandlePose> poses);

// Of the contact rows, see CalculixProblem::bone_motions. REQUIRES: as above.
Eigen::VectorXd BoneMotions(const TetMesh& mesh, const ConstraintSet& constraints,
                            absl::Span<const HandlePose> poses);

// kSmallMotion where the law is linear and there are gap elements, else 1.
double MotionScale(const CalculixProblem& problem);

// The problem as an input file of CalculiX (.inp): C3D4 elements, one material for each distinct
// stiffness, mm and Pa (so forces are in Pa mm^2), displacements of all vertices printed at the
// end.
//
// NEO HOOKE with C10 = E / (4 (1 + nu)) and D1 = 6 (1 - 2 nu) / E is
// W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2 with mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)).
//
// Motions and gaps are multiplied by MotionScale. A bilateral contact row is an equation, a
// unilateral one a gap element (GAPUNI), whose spring is kGapSpring; the bone of a row is a node of
// its own behind those of the mesh.
//
// Numbers have 13 digits: CalculiX reads the first 20 characters of a field and no more.
std::string CalculixInput(const CalculixProblem& problem);

}  // namespace tissueform
