// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/voxel_grid.h"
#include "core/imaging/metal/metal_detection.h"

namespace tissueform {

// Key `metal` of the recipe.
struct MetalOptions {
  bool correct = true;                 // false: metal is not looked for, nor its streaks reduced
  std::optional<double> threshold_hu;  // above it a voxel is metal; found from the CT if not given
};

// What was found and done.
struct MetalReport {
  std::vector<MetalCluster> clusters;  // by falling volume
  double volume_mm3 = 0;               // of all
  double threshold_hu = 0;
  int corrected_slices = 0;  // those with metal, and beside it where its blur is seen
  double low_z_mm = 0;       // of the metal, patient coordinates
  double high_z_mm = 0;

  // Where the skin was carried over from clean slices (core/imaging/metal/carried_skin.h).
  struct Carried {
    int slices = 0;
    double filled_mm3 = 0;
    double removed_mm3 = 0;
  };
  Carried carried;

  bool any() const { return !clusters.empty(); }
};

// Reduces the streaks of metal, slice by slice, from the reconstructed slices alone
// (core/imaging/metal/slice_correction.h), in place. Slices without metal, and all slices of a
// volume without metal, stay the same to the bit. Metal keeps its values; dead voxels inside it get
// 3000 HU.
//
// The result does not depend on `threads`.
MetalReport ReduceMetalArtifacts(const MetalFindings& findings, int threads, CtVolume* volume);

// A CT on upright cubic voxels, with its metal found and its streaks reduced.
struct CtWithMetal {
  HuGrid hu;
  // 1 where a quarter of the voxel or more is metal; without voxels where there is no metal.
  LabelGrid metal;
  // 1 where a quarter of the voxel or more was changed to carry the skin over; without voxels where
  // nothing was.
  LabelGrid carried_skin;
  // What `hu` was before, from 5 mm under to 5 mm over the metal; without voxels where there is
  // none.
  HuGrid before;
  // As ResampleUnscanned makes it, without the streaks of the metal.
  LabelGrid unscanned;
  MetalReport report;
};

// 1 where a quarter of the voxel or more is in the mask (as CtVolume::hu), on the grid that
// ResampleIsotropic makes of `volume`, whose values are overwritten. Errors: those of
// ResampleIsotropic.
absl::StatusOr<LabelGrid> ResampleMask(const std::vector<uint8_t>& mask, CtVolume volume,
                                       double spacing_mm, int threads);

// ResampleIsotropic of the volume without streaks, its skin carried over; of the volume itself
// where options.correct is false or no metal is found. Errors: those of ResampleIsotropic.
absl::StatusOr<CtWithMetal> ResampleWithoutStreaks(CtVolume volume, double spacing_mm,
                                                   const MetalOptions& options, int threads);

}  // namespace tissueform
