// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// The cylinder that a cone-beam scanner shows of a box; the rest of the box has one constant value.
// Found along any axis of the file: the four edges of the box along it have that value throughout,
// and the columns that do not are a disc, or a disc that the sides of the box cut off. At its rim
// at least four tenths of the voxels have another value: a round head in air that was cut off at
// the lowest value is not such a disc, as it does not reach its own outline in most slices. Null
// where there is no such cylinder. Its radius is 1.5 voxels less than that of the disc, whose rim
// scanners blur. The result does not depend on the values' unit.
std::optional<CylinderField> FindCylinderField(const CtVolume& volume);

// Of the plane across the cylinder's axis, the voxels (1) in it; the lower of its two axes is
// fastest.
std::vector<uint8_t> CrossSectionOf(const CylinderField& field, const CtVolume& volume);

// Calls visit(index, place in the cross-section) for every voxel, in rising order.
template <typename Visit>
void ForEachVoxelOfSection(const CylinderField& field, const CtVolume& volume, const Visit& visit) {
  const auto& [ni, nj, nk] = volume.size;
  size_t index = 0;
  for (int k = 0; k < nk; ++k) {
    for (int j = 0; j < nj; ++j) {
      for (int i = 0; i < ni; ++i, ++index) {
        const int64_t at = field.axis == 2   ? i + int64_t{ni} * j
                           : field.axis == 1 ? i + int64_t{ni} * k
                                             : j + int64_t{nj} * k;
        visit(index, static_cast<size_t>(at));
      }
    }
  }
}

}  // namespace tissueform
