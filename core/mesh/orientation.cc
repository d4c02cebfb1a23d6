// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/orientation.h"

#include "core/mesh/tet_quality.h"

namespace tissueform {

Eigen::Index RepairOrientation(const Positions& positions, TetIndices* tets) {
  if (tets->rows() == 0 || !(TetVolumes(positions, *tets).array() < 0).all()) return 0;
  tets->col(2).swap(tets->col(3));
  return tets->rows();
}

}  // namespace tissueform
