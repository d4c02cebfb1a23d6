// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// The way of the handles from one set of poses to another, as PoseBetween goes it: a full twist is
// walked through and not jumped over.
class LoadPath {
 public:
  // From where the handles rest.
  explicit LoadPath(absl::Span<const HandlePose> to);
  // REQUIRES: as many poses at both ends.
  LoadPath(absl::Span<const HandlePose> from, absl::Span<const HandlePose> to);

  // At load 0 the first end, at load 1 exactly the second.
  std::vector<HandlePose> PosesAt(double load) const;

  // The furthest that a handle turns on the whole way, in radians.
  double LargestTurn() const;

  // Carries every vertex along when the load goes from `begin` to `end`: x + sum_h u_h (T_h(x) - x)
  // with T_h the affine motion of handle h between the two loads and u_h (`shares`, #V by #handles)
  // how far the vertex goes with it. Vertices of the handle itself (share one) arrive exactly.
  Positions Carry(const Positions& positions, const Eigen::MatrixXd& shares, double begin,
                  double end) const;

 private:
  std::vector<HandlePose> from_;
  std::vector<HandlePose> to_;
};

}  // namespace tissueform
