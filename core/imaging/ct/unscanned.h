// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// What of a volume no scanner saw. Scanners show a circle of every slice and fill the rest with one
// value, as low as air or lower; programs that part or hide a face do the same. Tissue that ends
// there was cut off, and its end is no skin.

// The voxels (1) with such a filling. In every slice: what has one value, to the border of the
// slice, and beside it up to two pixels, each of which differs from the last by 12 HU at most. Air
// may have one value, too, where it was cut off at the lowest HU: so it counts only in slices where
// beside a quarter or more of its edge there is air that was measured. Empty where no tissue (over
// -500 HU) ends on it.
//
// Dark streaks of metal may end at the lowest HU, too, and join the filling to the tissue. The
// scanner's circle is the same in all slices: so in slices with metal, and up to 5 mm from them,
// only what the nearest other slice below or above has as filling counts, and 4 pixels around it.
// `metal` is 1 where a voxel is metal, laid out as `hu` of the volume; empty without metal.
//
// Outside of `volume.field`, where it is known, nothing was scanned, regardless of its value.
//
// The result does not depend on `threads`.
std::vector<uint8_t> FindUnscanned(const CtVolume& volume, int threads,
                                   const std::vector<uint8_t>& metal = {});

// 1 where half of the voxel or more was not scanned, on the grid that ResampleIsotropic makes of
// `volume`, and where that grid reaches beyond a volume that lies askew. Without voxels where
// nothing of the kind is. Errors: those of ResampleIsotropic.
absl::StatusOr<LabelGrid> ResampleUnscanned(const CtVolume& volume, double spacing_mm, int threads,
                                            const std::vector<uint8_t>& metal = {});

}  // namespace tissueform
