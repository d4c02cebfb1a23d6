// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/slice_gap_check.h"

#include <algorithm>

namespace tissueform {
namespace {

bool Lies(const Eigen::Vector3d& place, const SliceGap& gap, const std::vector<Plane>& region) {
  const double height_mm = gap.normal.dot(place);
  return height_mm > gap.from_mm && height_mm < gap.to_mm &&
         std::all_of(region.begin(), region.end(),
                     [&place](const Plane& plane) { return plane.HeightMm(place) >= 0; });
}

bool HoldsTissue(const SliceGap& gap, const SoftTissue& soft_tissue) {
  const std::vector<Plane> region = soft_tissue.region.planes();
  bool found = false;
  ForEachVoxel(soft_tissue.labels, [&](size_t /*index*/, const Eigen::Vector3d& place) {
    found = found || Lies(place, gap, region);
  });
  return found;
}

}  // namespace

std::optional<SliceGap> WidestGapInRegion(const std::vector<SliceGap>& gaps,
                                          const SoftTissue& soft_tissue) {
  std::optional<SliceGap> widest;
  for (const SliceGap& gap : gaps) {
    if (widest && gap.largest_mm <= widest->largest_mm) continue;
    if (HoldsTissue(gap, soft_tissue)) widest = gap;
  }
  return widest;
}

}  // namespace tissueform
