// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The edges of a mesh, and those whose cotangent weight is negative.
//
// The weight of edge ij is the sum over its tets of l_kl cot(theta_kl) / 6, with length and
// dihedral angle at the opposite edge kl: minus the entry L_ij of the Laplacian for one stiffness
// everywhere. Where it is negative, harmonic fields may leave [0, 1].
struct CotangentWeightSigns {
  Eigen::Index num_edges = 0;
  Eigen::Index num_negative = 0;
};

// Tets without volume contribute nothing.
CotangentWeightSigns CountNegativeCotangentWeights(const TetMesh& mesh);

}  // namespace tissueform
