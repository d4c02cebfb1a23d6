// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/grid_operations.h"

#include <algorithm>

namespace tissueform {

void ReportStage(const StageFunction& on_stage, absl::string_view stage, double fraction) {
  if (on_stage) on_stage(stage, fraction);
}

VoxelBox BoundingBox(const LabelGrid& labels) {
  VoxelBox box;
  box.first = labels.geometry.size;
  size_t index = 0;
  for (int z = 0; z < labels.geometry.size[2]; ++z) {
    for (int y = 0; y < labels.geometry.size[1]; ++y) {
      for (int x = 0; x < labels.geometry.size[0]; ++x, ++index) {
        if (labels.values[index] == 0) continue;
        box.first = {std::min(box.first[0], x), std::min(box.first[1], y),
                     std::min(box.first[2], z)};
        box.last = {std::max(box.last[0], x), std::max(box.last[1], y), std::max(box.last[2], z)};
      }
    }
  }
  return box;
}

VoxelBox Grown(const VoxelBox& box, int voxels, const GridGeometry& geometry) {
  VoxelBox grown = box;
  for (size_t axis = 0; axis < 3; ++axis) {
    grown.first[axis] = std::max(0, box.first[axis] - voxels);
    grown.last[axis] = std::min(geometry.size[axis] - 1, box.last[axis] + voxels);
  }
  return grown;
}

int64_t CountVoxels(const LabelGrid& mask) {
  return static_cast<int64_t>(mask.values.size()) -
         std::count(mask.values.begin(), mask.values.end(), uint8_t{0});
}

double VoxelVolumeMm3(const GridGeometry& geometry) {
  return geometry.spacing_mm * geometry.spacing_mm * geometry.spacing_mm;
}

double VolumeMm3(const LabelGrid& mask) {
  return static_cast<double>(CountVoxels(mask)) * VoxelVolumeMm3(mask.geometry);
}

LabelGrid Both(LabelGrid a, const LabelGrid& b) {
  for (size_t i = 0; i < a.values.size(); ++i) {
    a.values[i] = a.values[i] != 0 && b.values[i] != 0 ? 1 : 0;
  }
  return a;
}

}  // namespace tissueform
