// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/gray_values.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/imaging/metal/metal_reduction.h"
#include "core/planning/plan_building/recipe.h"

namespace tissueform {

// A CT as it is segmented: HU or gray values on their scale, without streaks, in cubic voxels.
struct ResampledCt {
  CtProvenance provenance;
  CtValuesReport values;
  std::array<int, 3> size = {0, 0, 0};  // of the CT as it was read
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Zero();
  std::string frame_uid;  // CtVolume::frame_uid
  LabelGrid unscanned;    // core/imaging/ct/unscanned.h
  CtWithMetal ct;
};

// Reads and resamples a CT as the recipe's keys "ct", "metal" and "spacing_mm" say. Calls
// `before_resampling` when the file has been read. Does not depend on `threads`.
//
// Errors: those of ReadCtVolume, PrepareValues and ResampleWithoutStreaks.
absl::StatusOr<ResampledCt> ReadResampledCt(const std::string& path, const Recipe& recipe,
                                            int threads,
                                            const std::function<void()>& before_resampling);

// The recipe for this CT: gray values have thresholds of their own.
Recipe WithThresholds(Recipe recipe, const CtValuesReport& values);

}  // namespace tissueform
