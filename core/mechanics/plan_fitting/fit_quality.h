// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/mechanics/plan_fitting/bounded_least_squares.h"

namespace tissueform {

// How well the targets determine one unknown. Bounds: an unknown at a bound is not evaluated, and
// the others are evaluated as if it were known.
struct Determination {
  // The part of it that the targets decide, 0 to 1; the rest is decided by moving least: by how
  // much they reduce the variance that the preference for small movements leaves to it.
  double by_targets = 0;
  // By how much (rad or mm) it would differ, one standard deviation, were every number that is
  // wanted off by 1 mm (of weight 1; a weight of 4 stands for half a mm), independently.
  double error_per_mm = 0;
};

// A combination of free unknowns, from what the targets determine best to what they determine
// least.
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

}  // namespace tissueform
