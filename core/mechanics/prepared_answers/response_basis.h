// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/vertex_response.h"

namespace tissueform {

struct ResponseBasisOptions {
  double tolerance_mm = 0.01;  // of any chosen vertex against the direct solve
  // The prepared range, of every handle by itself.
  double max_rotation_rad = 30.0 * std::numbers::pi / 180.0;
  double max_scale_change = 0.1;  // |s - 1|
  // May be empty. Called with the bytes that the basis needs at most, while it is made and later,
  // before any of them is allocated.
  FactorAdmission admission = nullptr;
  PreparationObserver observer = nullptr;  // may be empty; receives the columns
};

// What a basis will be, known from the tolerance and the prepared range before anything is built.
struct ResponseBasisPlan {
  int degree = 0;     // largest total degree of the polynomials
  int num_terms = 0;  // columns: 3 for every polynomial and 4 for every handle, to be compressed
  int64_t bytes = 0;  // that computing the basis takes at most
};

// A basis of more polynomials than this is refused: it would be slower than the direct solve.
inline constexpr int kMaxResponsePolynomials = 500;

// Errors: InvalidArgument (an option that is not a positive number or, for the scale, outside [0,
// 1); a range so wide or a tolerance so small that kMaxResponsePolynomials are not enough).
absl::StatusOr<ResponseBasisPlan> PlanResponseBasis(const MeshPreparation& preparation,
                                                    Eigen::Index num_vertices,
                                                    const ResponseBasisOptions& options);

// The response basis of the gradient field with propagated rotations and cotangent guidance, at
// `vertices` (any order). In that mode the answer is linear in the rotation field P, and P depends
// on the place through the harmonic values u only. With P - I = sum_n C_n(poses) B_n(u) (see
// ExpandRotation), o_h the centroid of handle h and d the displacements,
//   d = sum_h [ (s_h R_h - I) X_h + (c_h - o_h + s_h R_h (o_h - c_h) + t_h) u_h ] + sum_n C_n Phi_n
// (see TermResponses for X_h and Phi_n). Written for displacements: identity poses give rest.
//
// The bound is the sum of what the polynomials of the next degree would add, measured with their
// own responses; of the degree after that and of the remainder, with the largest responses that
// were measured; of what the compression of the columns cut (ColumnCompression); and of rounding to
// single precision.
//
// Factorises the Laplacian if no model has done so. Holds the columns only, not the preparation.
//
// Errors: those of PlanResponseBasis and MeshPreparation::Laplacian; InvalidArgument (a vertex
// outside [0, #V), no vertex); what the admission says, before anything is allocated.
absl::StatusOr<std::unique_ptr<VertexResponse>> CreateResponseBasis(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const ResponseBasisOptions& options, const Cancellation& cancellation = {});

}  // namespace tissueform
