// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// How far the skin of a mesh lies from where the CT passes a threshold, in mm.
struct SkinDistance {
  std::vector<double> mm;  // of every vertex measured
  double mean_mm = 0;
  double p99_mm = 0;
  double max_mm = 0;
  int64_t not_found = 0;  // vertices with no such place within the search; not in the figures above
};

// From every vertex on skin along its normal, to both sides, up to four voxels, to the nearest
// place where the interpolated CT has the value `threshold_hu`. It knows nothing of how the surface
// was extracted. `on_skin` has an entry a vertex of the surface or more.
SkinDistance MeasureSkinDistance(const TriangleMesh& surface, const std::vector<bool>& on_skin,
                                 const HuGrid& hu, double threshold_hu);

}  // namespace tissueform
