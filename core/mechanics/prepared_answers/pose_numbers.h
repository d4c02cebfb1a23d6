// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/types/span.h"
#include <Eigen/Core>

#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

constexpr Eigen::Index kNumbersPerHandle = 6;

// What a series in the poses is a series in: of every handle three numbers of its turn and the
// movement of its middle at rest, which `centroids` tell, in mm. Of the turn not the angle itself
// but its sine, times the axis: what R - I is odd in, so that columns which hold R - I whole and
// those of these numbers agree to third order either way. Scales are left out.
Eigen::VectorXd PoseNumbers(absl::Span<const HandlePose> poses,
                            const std::vector<Eigen::Vector3d>& centroids);

// n_a n_b for all pairs a <= b, in the order of NumFieldPairs; twice that where they differ.
Eigen::VectorXd PairProducts(const Eigen::VectorXd& numbers);

// w x v as a matrix that v is multiplied with: what a turn is to first order.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& w);

}  // namespace tissueform
