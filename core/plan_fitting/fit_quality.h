// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/mesh/tet_mesh.h"
#include "core/plan_fitting/bounded_least_squares.h"
#include "core/plan_fitting/fit_problem.h"

namespace tissueform {

// How much bone moves, to first order: with q the six numbers of a handle's pose (rotation vector
// in rad, translation in mm), |S q|^2 is the mean of the squared displacements of its vertices.
Eigen::Matrix<double, 6, 6> MovementRoot(const TetMesh& mesh, const std::vector<int32_t>& vertices,
                                         const Eigen::Vector3d& pivot_mm);

// How well the targets tell one unknown. What is said of bounds: an unknown that one holds is not
// asked about, and the others are told as if it were known.
struct Determination {
  // The part of it that the targets decide, 0 to 1; the rest is decided by moving least: by how
  // much they lessen the variance that the wish to move little leaves to it.
  double by_targets = 0;
  // By how much (rad or mm) it would differ, one standard deviation, were every number that is
  // wanted off by 1 mm (of weight 1; a weight of 4 stands for half a mm), independently.
  double error_per_mm = 0;
};

// A combination of free unknowns, from what the targets tell best to what they tell least.
struct FitDirection {
  // mm (rms over the targets' numbers, weighted) that change with 1 mm of movement of bone.
  double singular_value = 0;
  double by_targets = 0;              // as above
  Eigen::VectorXd shares;             // of the unknowns: rad or mm that 1 mm of movement holds
  std::vector<size_t> main_unknowns;  // those that move bone most in it, largest first
};

struct FitQuality {
  std::vector<Determination> unknowns;
  std::vector<FitDirection> directions;
};

// `jacobian`: of the weighted rows, by unknowns in rad and mm; `movement`: |movement x|^2 is the
// movement of bone; `bounds`: those that hold an unknown.
FitQuality MeasureFitQuality(const Eigen::MatrixXd& jacobian, const Eigen::MatrixXd& movement,
                             const std::vector<ActiveBound>& bounds, double less_movement);

// Pairs of targets that ask the same of the bone and want different things: rows that are nearly
// parallel, missed to opposite sides, both by more than the tolerance.
std::vector<std::pair<size_t, size_t>> FindContradictions(const FitProblem& problem,
                                                          const Eigen::MatrixXd& jacobian,
                                                          const Eigen::VectorXd& misses_mm);

}  // namespace tissueform
