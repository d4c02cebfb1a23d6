// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"

namespace tissueform {

// When every tet is negative, swaps its last two vertices, so that every tet is positive, and
// returns their number; otherwise changes nothing and returns 0. A whole mesh of negative tets was
// written with the other vertex convention and is sound. A negative tet among positive ones may as
// well be folded space, which no swap repairs: it is left for ValidateTetMesh to report.
//
// REQUIRES: `tets` names rows of `positions`.
Eigen::Index RepairOrientation(const Positions& positions, TetIndices* tets);

}  // namespace tissueform
