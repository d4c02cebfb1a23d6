// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/metal/parallel_beam.h"

namespace tissueform {

// A volume as the scanner made it, slice by slice: across the axis of the file that is nearest to
// the patient's, whichever of the three that is.
struct SliceStack {
  int slices = 0;
  double slice_mm = 1;  // from one to the next
  SliceShape shape;
  int64_t to_next_slice = 0;  // steps through CtVolume::hu
  int64_t to_next_column = 0;
  int64_t to_next_row = 0;

  explicit SliceStack(const CtVolume& volume);

  size_t Index(int slice, int x, int y) const {
    return static_cast<size_t>(slice * to_next_slice + x * to_next_column + y * to_next_row);
  }
  // (slice, x, y)
  std::array<int, 3> Place(size_t index) const;
};

// Marks what the mask encloses in a slice, over faces, where that is smaller than `largest_mm2`.
void FillHoles(const SliceStack& stack, int slice, double largest_mm2, std::vector<uint8_t>* mask);

// How rough soft tissue is in a block of a slice, in HU: the mean difference, without sign, between
// a voxel and the mean of those 2 mm beside it on both sides, along rows and along columns, where
// all are soft tissue (-300 to 300 HU). Noise gives about its standard deviation, streaks several
// times as much. Negative where there is too little soft tissue.
double Roughness(const CtVolume& volume, const SliceStack& stack, int slice,
                 const std::array<int, 2>& first, const std::array<int, 2>& last);

}  // namespace tissueform
