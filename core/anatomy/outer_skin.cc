// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/anatomy/outer_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "core/anatomy/grid_operations.h"
#include "core/anatomy/itk_filters.h"

namespace tissueform {
namespace {

using Voxel = std::array<int, 3>;

// With a layer of `voxels` all round that goes on as the border.
LabelGrid Padded(const LabelGrid& mask, int voxels) {
  GridGeometry geometry = mask.geometry;
  for (int& size : geometry.size) size += 2 * voxels;
  geometry.origin_mm.array() -= voxels * geometry.spacing_mm;
  LabelGrid padded(geometry);
  const auto inner = [&](int at, size_t axis) {
    return std::clamp(at - voxels, 0, mask.geometry.size[axis] - 1);
  };
  for (int z = 0; z < geometry.size[2]; ++z) {
    for (int y = 0; y < geometry.size[1]; ++y) {
      for (int x = 0; x < geometry.size[0]; ++x) {
        padded.At(x, y, z) = mask.At(inner(x, 0), inner(y, 1), inner(z, 2));
      }
    }
  }
  return padded;
}

LabelGrid Both(LabelGrid a, const LabelGrid& b) {
  for (size_t i = 0; i < a.values.size(); ++i) {
    a.values[i] = a.values[i] != 0 && b.values[i] != 0 ? 1 : 0;
  }
  return a;
}

// Dijkstra's search over the 26 neighbours.
class NearestFirst {
 public:
  NearestFirst(const LabelGrid& mask, double reach_mm)
      : mask_(mask),
        reach_mm_(static_cast<float>(reach_mm)),
        distance_(mask.geometry, std::numeric_limits<float>::infinity()) {}

  // From the seeds that lie in the mask.
  VoxelGrid<float> Run(const LabelGrid& seeds) {
    for (size_t i = 0; i < seeds.values.size(); ++i) {
      if (seeds.values[i] != 0 && mask_.values[i] != 0) distance_.values[i] = 0;
    }
    QueueBorderOfSeeds();
    while (!queue_.empty()) {
      const auto [mm, voxel] = queue_.top();
      queue_.pop();
      if (mm == distance_.At(voxel[0], voxel[1], voxel[2])) Leave(voxel, mm);
    }
    return std::move(distance_);
  }

 private:
  // Seeds among seeds lead nowhere, and there are millions of them.
  void QueueBorderOfSeeds() {
    const auto [nx, ny, nz] = mask_.geometry.size;
    for (int z = 0; z < nz; ++z) {
      for (int y = 0; y < ny; ++y) {
        for (int x = 0; x < nx; ++x) {
          if (distance_.At(x, y, z) == 0) Leave({x, y, z}, 0);
        }
      }
    }
  }

  void Offer(const Voxel& voxel, float mm) {
    const auto [x, y, z] = voxel;
    if (mm > reach_mm_ || !mask_.geometry.Contains(x, y, z) || mask_.At(x, y, z) == 0) return;
    float& best = distance_.At(x, y, z);
    if (mm >= best) return;
    best = mm;
    queue_.push({mm, voxel});
  }

  void Leave(const Voxel& voxel, float mm) {
    const auto step_mm = static_cast<float>(mask_.geometry.spacing_mm);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const float voxels = std::sqrt(static_cast<float>(dx * dx + dy * dy + dz * dz));
          if (voxels > 0)
            Offer({voxel[0] + dx, voxel[1] + dy, voxel[2] + dz}, mm + step_mm * voxels);
        }
      }
    }
  }

  using Entry = std::pair<float, Voxel>;

  const LabelGrid& mask_;
  float reach_mm_;
  VoxelGrid<float> distance_;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

bool HasFaceOn(const LabelGrid& mask, int x, int y, int z) {
  const auto is_in = [&mask](int a, int b, int c) {
    return mask.geometry.Contains(a, b, c) && mask.At(a, b, c) != 0;
  };
  return is_in(x - 1, y, z) || is_in(x + 1, y, z) || is_in(x, y - 1, z) || is_in(x, y + 1, z) ||
         is_in(x, y, z - 1) || is_in(x, y, z + 1);
}

}  // namespace

LabelGrid OutsideAir(const HeadSegmentation& head, const OuterSkinOptions& options) {
  const double radius_mm = options.opening_radius_mm;
  const double voxel_mm = head.hu.geometry.spacing_mm;
  const int padding = static_cast<int>(std::ceil(radius_mm / voxel_mm)) + 2;
  const LabelGrid air = Padded(
      MaskWhere(head.hu, [&](int16_t hu) { return hu <= head.options.tissue_above_hu; }), padding);
  const LabelGrid tissue = MaskWhere(air, [](uint8_t value) { return value == 0; });
  const LabelGrid free = MaskWhere(DistanceMm(tissue), [=](float mm) { return mm > radius_mm; });
  const LabelGrid centres = LargestComponent(free, Neighbours::kFaces);
  const LabelGrid opened =
      Both(MaskWhere(DistanceMm(centres), [=](float mm) { return mm <= radius_mm; }), air);
  const VoxelGrid<float> beyond = DistanceWithin(air, opened, options.crease_mm);
  const LabelGrid outside = MaskWhere(beyond, [](float mm) { return std::isfinite(mm); });
  VoxelBox inner;
  for (size_t axis = 0; axis < 3; ++axis) {
    inner.first[axis] = padding;
    inner.last[axis] = padding + head.hu.geometry.size[axis] - 1;
  }
  LabelGrid result = Crop(outside, inner);
  result.geometry = head.hu.geometry;  // without the rounding of the way there and back
  return result;
}

LabelGrid VoxelsFacing(const LabelGrid& outside_air, const LabelGrid& mask) {
  LabelGrid facing(mask.geometry);
  for (int z = 0; z < mask.geometry.size[2]; ++z) {
    for (int y = 0; y < mask.geometry.size[1]; ++y) {
      for (int x = 0; x < mask.geometry.size[0]; ++x) {
        if (mask.At(x, y, z) != 0 && HasFaceOn(outside_air, x, y, z)) facing.At(x, y, z) = 1;
      }
    }
  }
  return facing;
}

VoxelGrid<float> DistanceWithin(const LabelGrid& mask, const LabelGrid& seeds, double reach_mm) {
  return NearestFirst(mask, reach_mm).Run(seeds);
}

}  // namespace tissueform
