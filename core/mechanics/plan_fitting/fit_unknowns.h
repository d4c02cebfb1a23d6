// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <numbers>
#include <vector>

#include <Eigen/Core>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/plan_fitting/bounded_least_squares.h"
#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// By which slopes of turns are measured, see fit_unknowns.cc.
inline constexpr double kFitRotationStep = 0.5 * std::numbers::pi / 180;

// The unknowns of a problem as the search has them: scaled, so that one of each alone is 1 mm of
// movement of bone (root mean square over the handle's vertices).
class FitUnknowns {
 public:
  // `problem` outlives it.
  FitUnknowns(const FitProblem& problem, const TetMesh& mesh, const ConstraintSet& constraints);

  std::vector<HandlePose> PosesOf(const Eigen::VectorXd& x) const;
  Eigen::VectorXd Start() const;  // the poses of the problem
  // Bounds, steps of the differences, and the rows of least movement.
  void Describe(LeastSquaresProblem* search) const;

  // mm of movement for a rad or a mm of each.
  const Eigen::VectorXd& scales() const { return scales_; }
  // |movement() * q|^2 is the movement by unknowns in rad and mm.
  const Eigen::MatrixXd& movement() const { return movement_; }
  // Rms over the vertices of all moving handles, from rest, to first order.
  double MovementMm(const Eigen::VectorXd& x) const;

 private:
  const FitProblem& problem_;
  Eigen::MatrixXd movement_;        // six rows a handle
  Eigen::VectorXd movement_rest_;   // what does not move of the handles that do
  Eigen::VectorXd handle_weights_;  // by how many vertices they have; 0 of those that do not move
  Eigen::VectorXd scales_;
};

}  // namespace tissueform
