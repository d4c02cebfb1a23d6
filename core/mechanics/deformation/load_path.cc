// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/load_path.h"

#include <algorithm>

namespace tissueform {
namespace {

// Of poses with the same pivots: nothing moves but what has to.
std::vector<HandlePose> RestPoses(absl::Span<const HandlePose> to) {
  std::vector<HandlePose> rest(to.size());
  std::transform(to.begin(), to.end(), rest.begin(), RestOf);
  return rest;
}

Eigen::Matrix3d LinearPart(const HandlePose& pose) {
  return pose.scale * RotationMatrix(pose.rotation_vector);
}

}  // namespace

LoadPath::LoadPath(absl::Span<const HandlePose> to)
    : from_(RestPoses(to)), to_(to.begin(), to.end()) {}

LoadPath::LoadPath(absl::Span<const HandlePose> from, absl::Span<const HandlePose> to)
    : from_(from.begin(), from.end()), to_(to.begin(), to.end()) {}

std::vector<HandlePose> LoadPath::PosesAt(double load) const {
  // To the bit: (1 - load) * a + load * b would leave rounding in the constrained vertices.
  if (load == 1.0) {
    return to_;
  }
  std::vector<HandlePose> poses(to_.size());
  for (size_t h = 0; h < to_.size(); ++h) {
    poses[h] = PoseBetween(from_[h], to_[h], load);
  }
  return poses;
}

double LoadPath::LargestTurn() const {
  double largest = 0;
  for (size_t h = 0; h < to_.size(); ++h) {
    largest = std::max(largest, (to_[h].rotation_vector - from_[h].rotation_vector).norm());
  }
  return largest;
}

Positions LoadPath::Carry(const Positions& positions, const Eigen::MatrixXd& shares, double begin,
                          double end) const {
  const std::vector<HandlePose> before = PosesAt(begin);
  const std::vector<HandlePose> after = PosesAt(end);
  Positions carried = positions;
  for (size_t h = 0; h < before.size(); ++h) {
    // T(x) = c' + M (x - c - t) + t' takes the pose before to the pose after.
    const Eigen::Matrix3d M = LinearPart(after[h]) * LinearPart(before[h]).inverse();
    const Eigen::Vector3d origin = ApplyPose(before[h], before[h].pivot_mm);
    const Eigen::Vector3d image = ApplyPose(after[h], before[h].pivot_mm);
    const auto share = shares.col(static_cast<Eigen::Index>(h));
    for (Eigen::Index v = 0; v < positions.rows(); ++v) {
      const Eigen::Vector3d x = positions.row(v);
      carried.row(v) += share[v] * (image + M * (x - origin) - x).transpose();
    }
  }
  return carried;
}

}  // namespace tissueform
