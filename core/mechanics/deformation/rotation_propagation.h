// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// A 3 by 3 matrix per cell, row-major in a row of nine.
using CellTransforms = Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>;

// The rotation field that the handles' poses spread over the cells (Liao et al. 2009, section 3.2,
// for several handles):
//   P_c = (1 + sum_h u_h (s_h - 1)) * exp([sum_h u_h w_h])
// with u_h the harmonic field of handle h at the barycentre (the mean of `harmonic`, #V by
// #handles, over the corners), w_h its rotation vector and s_h its scale. Pivots and translations
// play no part: P turns gradients. `transforms` is resized to #C rows, or to none, which stands for
// the identity, when no pose turns or scales. It may be used again and again, which saves mapping
// fresh memory for every pose.
void PropagateRotations(const PiecewiseLinearElements& elements, const Eigen::MatrixXd& harmonic,
                        absl::Span<const HandlePose> poses, int threads,
                        CellTransforms* transforms);

}  // namespace tissueform
