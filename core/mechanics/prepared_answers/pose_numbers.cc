// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/pose_numbers.h"

#include "core/mechanics/elasticity/neo_hookean_expansion.h"

namespace tissueform {

Eigen::VectorXd PoseNumbers(absl::Span<const HandlePose> poses,
                            const std::vector<Eigen::Vector3d>& centroids) {
  Eigen::VectorXd numbers(kNumbersPerHandle * static_cast<Eigen::Index>(poses.size()));
  for (size_t h = 0; h < poses.size(); ++h) {
    const Eigen::Matrix3d R = RotationMatrix(poses[h].rotation_vector);
    auto own = numbers.segment<kNumbersPerHandle>(kNumbersPerHandle * static_cast<Eigen::Index>(h));
    own.head<3>() = 0.5 * Eigen::Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
    own.tail<3>() = ApplyPose(poses[h], centroids[h]) - centroids[h];
  }
  return numbers;
}

Eigen::VectorXd PairProducts(const Eigen::VectorXd& numbers) {
  Eigen::VectorXd products(NumFieldPairs(numbers.size()));
  Eigen::Index pair = 0;
  for (Eigen::Index a = 0; a < numbers.size(); ++a) {
    for (Eigen::Index b = a; b < numbers.size(); ++b) {
      products[pair++] = (a == b ? 1 : 2) * numbers[a] * numbers[b];
    }
  }
  return products;
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& w) {
  Eigen::Matrix3d cross;
  cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return cross;
}

}  // namespace tissueform
