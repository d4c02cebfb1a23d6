// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// Signed volumes, #T, in mm^3: det(v1 - v0, v2 - v0, v3 - v0) / 6. `positions` may be rest or
// deformed.
Eigen::VectorXd TetVolumes(const Positions& positions, const TetIndices& tets);

// When every tet is negative, swaps its last two vertices, so that every tet is positive, and
// returns their number; otherwise changes nothing and returns 0. A whole mesh of negative tets was
// written with the other vertex convention and is sound. A negative tet among positive ones may as
// well be folded space, which no swap repairs: it is left for ValidateTetMesh to report.
//
// REQUIRES: `tets` names rows of `positions`.
Eigen::Index RepairOrientation(const Positions& positions, TetIndices* tets);

// Dihedral angles in degrees, #T by 6, column e at edge e of kTetEdges. NaN where a facet has no
// area.
Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor> DihedralAnglesDeg(
    const Positions& positions, const TetIndices& tets);

// What a person wants to know of a mesh at one glance.
struct TetQualitySummary {
  double total_volume_mm3 = 0;
  double min_volume_mm3 = 0;
  double max_volume_mm3 = 0;
  double min_dihedral_deg = 0;
  double max_dihedral_deg = 0;
  Eigen::Index tets_below_5_deg = 0;   // smallest dihedral angle under 5 degrees
  Eigen::Index tets_below_10_deg = 0;  // smallest dihedral angle under 10 degrees
};
TetQualitySummary SummarizeTetQuality(const TetMesh& mesh);

}  // namespace tissueform
