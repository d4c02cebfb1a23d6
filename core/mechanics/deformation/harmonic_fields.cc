// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/harmonic_fields.h"

#include <map>

namespace tissueform {

namespace {

// The region that each guided vertex goes with; that of its first row where it slides on several.
std::map<int32_t, int> GuidingRegions(const ConstraintSet& constraints) {
  std::map<int32_t, int> regions;
  for (size_t c = 0; c < constraints.constrained().size(); ++c) {
    regions[constraints.constrained()[c]] = constraints.region_of_constrained()[c];
  }
  for (const ContactRow& row : constraints.contact()) {
    if (row.bilateral) regions.emplace(row.vertex, row.handle);
  }
  return regions;
}
static_assert(ContactRow::kFixedBone == ConstraintSet::kFixed);

}  // namespace

std::vector<int32_t> GuidedVertices(const ConstraintSet& constraints) {
  std::vector<int32_t> vertices;
  for (const auto& [vertex, region] : GuidingRegions(constraints)) vertices.push_back(vertex);
  return vertices;
}

absl::StatusOr<Eigen::MatrixXd> ComputeHarmonicFields(const ConstraintSet& constraints,
                                                      DirichletSystem* laplacian) {
  const std::map<int32_t, int> regions = GuidingRegions(constraints);
  Eigen::MatrixXd values =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(regions.size()),
                            static_cast<Eigen::Index>(constraints.handles().size()));
  Eigen::Index place = 0;
  for (const auto& [vertex, region] : regions) {
    if (region != ConstraintSet::kFixed) values(place, region) = 1;
    ++place;
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
