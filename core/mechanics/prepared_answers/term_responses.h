// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/simplex_polynomials.h"

namespace tissueform {

// Phi_n = A^-1 G^T M' diag(B_n(u)) grad v for the polynomials from `first` on: the displacements,
// #V by 3 * count (axis fastest), when every tet's gradient is pulled by B_n of the harmonic values
// at its barycentre and all constrained vertices rest. With the rotation field P - I = sum_n C_n
// B_n, the free part of the propagated answer is sum_n C_n Phi_n.
//
// One pass over the factor for all of them. REQUIRES: all barycentre values lie in the domain.
// Errors: those of MeshPreparation::Laplacian.
absl::StatusOr<Eigen::MatrixXd> TermResponses(const SimplexDomain& domain,
                                              const SimplexPolynomials& polynomials,
                                              Eigen::Index first, Eigen::Index count,
                                              MeshPreparation* preparation);

// X_h: the harmonic extension, #V by 3, of v - `origin` given on handle h, zero on all other
// constrained vertices.
absl::StatusOr<Eigen::MatrixXd> HandleResponse(int handle, const Eigen::Vector3d& origin,
                                               MeshPreparation* preparation);

}  // namespace tissueform
