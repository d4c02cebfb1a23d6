// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// How well the tets came through a deformation.
struct DeformationQuality {
  Eigen::Index inverted_tets = 0;  // deformed volume <= 0
  double min_volume_ratio = 1;     // deformed / rest volume, over the tets
  Eigen::Index worst_tet = 0;      // that of the smallest ratio
  double max_volume_ratio = 1;
  double total_volume_ratio = 1;  // of the whole mesh
  double max_displacement_mm = 0;
};

// REQUIRES: `deformed` is #V by 3; every rest tet has positive volume.
DeformationQuality MeasureDeformation(const TetMesh& rest, const Positions& deformed);

}  // namespace tissueform
