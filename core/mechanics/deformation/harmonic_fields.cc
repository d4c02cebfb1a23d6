// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/harmonic_fields.h"

namespace tissueform {

absl::StatusOr<Eigen::MatrixXd> ComputeHarmonicFields(const ConstraintSet& constraints,
                                                      DirichletSystem* laplacian) {
  const std::vector<int>& regions = constraints.region_of_constrained();
  Eigen::MatrixXd values =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(regions.size()),
                            static_cast<Eigen::Index>(constraints.handles().size()));
  for (size_t c = 0; c < regions.size(); ++c) {
    if (regions[c] != ConstraintSet::kFixed) {
      values(static_cast<Eigen::Index>(c), regions[c]) = 1;
    }
  }
  // All handles in one pass over the factor. What leaves [0, 1], because obtuse tets have negative
  // weights, is left so and reported (harmonic_min, harmonic_max): clamping would break the sum of
  // one and with it the answer to equal poses.
  return laplacian->Solve(Eigen::MatrixXd(), values);
}

CellField SampleAtBarycentres(const Eigen::Ref<const CellIndices>& cells,
                              const Eigen::MatrixXd& at_vertices) {
  CellField at_cells = CellField::Zero(cells.rows(), at_vertices.cols());
  for (Eigen::Index c = 0; c < cells.rows(); ++c) {
    for (Eigen::Index corner = 0; corner < cells.cols(); ++corner) {
      at_cells.row(c) += at_vertices.row(cells(c, corner));
    }
    at_cells.row(c) /= static_cast<double>(cells.cols());
  }
  return at_cells;
}

}  // namespace tissueform
