// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/deformation_quality.h"

#include <cmath>

#include "core/mesh/tet_quality.h"

namespace tissueform {

DeformationQuality MeasureDeformation(const TetMesh& rest, const Positions& deformed) {
  const Eigen::VectorXd before = TetVolumes(rest.positions(), rest.tets());
  const Eigen::VectorXd after = TetVolumes(deformed, rest.tets());
  const Eigen::VectorXd ratios = after.cwiseQuotient(before);
  DeformationQuality quality;
  quality.inverted_tets = (after.array() <= 0).count();
  quality.min_volume_ratio = ratios.minCoeff(&quality.worst_tet);
  quality.max_volume_ratio = ratios.maxCoeff();
  quality.total_volume_ratio = after.sum() / before.sum();
  quality.max_displacement_mm =
      std::sqrt((deformed - rest.positions()).rowwise().squaredNorm().maxCoeff());
  return quality;
}

}  // namespace tissueform
