// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/accuracy/bar_ends.h"

#include "client/accuracy/boundary_surface.h"

namespace tissueform {

absl::StatusOr<ConstraintSet> ConstrainEnds(const Positions& positions) {
  const double low = positions.col(2).minCoeff();
  const double high = positions.col(2).maxCoeff();
  return ConstraintSet::Create(
      positions.rows(),
      VerticesWhere(positions, [=](const Eigen::Vector3d& v) { return v.z() == low; }),
      {{"end", VerticesWhere(positions, [=](const Eigen::Vector3d& v) { return v.z() == high; })}});
}

}  // namespace tissueform
