// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mechanics/plan_fitting/skin_points.h"

namespace tissueform {

// The targets of a problem as rows: one for every number that is wanted, in their order.
class FitRows {
 public:
  explicit FitRows(const FitProblem& problem);  // outlives it

  // The vertices that the targets look at, rising: those for which answers are prepared.
  const std::vector<int32_t>& vertices() const { return vertices_; }
  const Eigen::VectorXd& wanted_mm() const { return wanted_mm_; }
  const Eigen::VectorXd& root_weights() const { return root_weights_; }

  // What of the targets' displacements is looked at, when vertices() are at these positions.
  Eigen::VectorXd At(const Positions& chosen) const;
  // Where the point of a target is then.
  Eigen::Vector3d PointAt(size_t target, const Positions& chosen) const {
    return PositionOf(points_[target], chosen);
  }

 private:
  const FitProblem& problem_;
  std::vector<int32_t> vertices_;
  std::vector<MeshPoint> points_;  // by their places in vertices_
  Eigen::VectorXd wanted_mm_;
  Eigen::VectorXd root_weights_;
};

}  // namespace tissueform
