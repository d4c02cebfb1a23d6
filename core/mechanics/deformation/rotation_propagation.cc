// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/rotation_propagation.h"

#include <algorithm>

#include "core/base/parallel_for.h"
#include "core/mechanics/deformation/harmonic_fields.h"

namespace tissueform {

void PropagateRotations(const PiecewiseLinearElements& elements, const Eigen::MatrixXd& harmonic,
                        absl::Span<const HandlePose> poses, int threads,
                        CellTransforms* transforms) {
  constexpr Eigen::Index kCellGrain = 4096;
  const bool identity = std::all_of(poses.begin(), poses.end(), [](const HandlePose& pose) {
    return pose.rotation_vector.isZero(0) && pose.scale == 1.0;
  });
  // No rows stand for identities everywhere: while a handle is only pushed, which is what a plan
  // mostly does, there is nothing to blend and no right-hand side.
  transforms->resize(identity ? 0 : elements.num_cells(), 9);
  ParallelFor(threads, transforms->rows(), kCellGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index c = begin; c < end; ++c) {
      // Rotation vectors are mixed, not matrices or quaternions: those know no full turn, and mixed
      // matrices are no rotations. For one handle this is the source's blend.
      Eigen::Vector3d rotation_vector = Eigen::Vector3d::Zero();
      double scale = 1.0;
      for (size_t h = 0; h < poses.size(); ++h) {
        const double u =
            MeanOverCorners(elements.cells, harmonic.col(static_cast<Eigen::Index>(h)), c);
        rotation_vector += u * poses[h].rotation_vector;
        scale += u * (poses[h].scale - 1.0);
      }
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(transforms->row(c).data()) =
          scale * RotationMatrix(rotation_vector);
    }
  });
}

}  // namespace tissueform
