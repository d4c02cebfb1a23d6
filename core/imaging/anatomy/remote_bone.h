// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <limits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include <Eigen/Core>

namespace tissueform {

using Places = std::vector<Eigen::Vector3d>;  // mm, LPS

// What a place is looked for in, and how wide its voxels are.
struct Candidates {
  Places places;
  double voxel_mm = 1;
};

// Where across the direction a bone's end has its place: in the middle of its farthest part, of
// that volume. A quarter of a molar's crown, by default: with 30 or 100 mm3 a filling moved a molar
// by 2.4 to 2.7 mm, as what one more layer of voxels held decided where.
struct EndShape {
  double volume_mm3 = 200;
  // Moved onto what is that near to the middle: front teeth stand in an arch, whose middle lies
  // behind them, on those of the other jaw.
  double near_mm = std::numeric_limits<double>::infinity();
};

// The place of a bone's end along `direction`, a unit vector: as far as the mean of its farthest 30
// mm3, and across that direction as `shape` says (of all, where there is less). The farthest voxel
// alone would be the noise's: where a crown ends, two sets of photons of one head differ by a voxel
// here and there, and a filling's blur adds some.
//
// Errors: InvalidArgument that names the place when there are no candidates. Internal to
// core/imaging/anatomy.
absl::Status Farthest(const Candidates& candidates, const Eigen::Vector3d& direction,
                      absl::string_view name, Eigen::Vector3d* found, const EndShape& shape = {});

}  // namespace tissueform
