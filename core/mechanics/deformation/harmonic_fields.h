// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// The vertices at which harmonic fields are given, rising: the constrained ones, and those that
// slide on a bone (have a bilateral contact row), since tissue that slides on a bone turns with it.
// With rows in all directions they are like others of the region.
std::vector<int32_t> GuidedVertices(const ConstraintSet& constraints);

// One harmonic field per handle, #V by #handles: L u_h = 0 at free vertices, u_h = 1 on handle h
// and where tissue slides on it, 0 on the fixed region and on the other handles (Liao et al. 2009,
// Eq. 8). With the field of the fixed region they sum to one. Values lie in [0, 1] unless L has
// negative weights.
//
// `laplacian` is the Dirichlet system of L with GuidedVertices(constraints) prescribed; all fields
// are solved in one pass over its factor.
absl::StatusOr<Eigen::MatrixXd> ComputeHarmonicFields(const ConstraintSet& constraints,
                                                      DirichletSystem* laplacian);

// Mean over the vertices of every cell (#C by 3 or 4): the value at its barycentre. #C by the
// columns of `at_vertices`.
using CellField = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
CellField SampleAtBarycentres(const Eigen::Ref<const CellIndices>& cells,
                              const Eigen::MatrixXd& at_vertices);

// The same for one cell and one column: cheaper than keeping all of them.
inline double MeanOverCorners(const Eigen::Map<const CellIndices>& cells,
                              const Eigen::Ref<const Eigen::VectorXd>& at_vertices,
                              Eigen::Index cell) {
  double sum = 0;
  for (Eigen::Index corner = 0; corner < cells.cols(); ++corner) {
    sum += at_vertices[cells(cell, corner)];
  }
  return sum / static_cast<double>(cells.cols());
}

}  // namespace tissueform
