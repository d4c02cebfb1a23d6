// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/outer_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"

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

// Dijkstra's search over the 26 neighbours; not across an edge or a corner of what is not in the
// mask, or a thin wall that runs askew through the grid would leak.
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

  bool IsNearer(const Voxel& voxel, float mm) const {
    const auto [x, y, z] = voxel;
    return mm <= reach_mm_ && mask_.geometry.Contains(x, y, z) && mask_.At(x, y, z) != 0 &&
           mm < distance_.At(x, y, z);
  }

  void Put(const Voxel& voxel, float mm) {
    distance_.At(voxel[0], voxel[1], voxel[2]) = mm;
    queue_.push({mm, voxel});
  }

  void Leave(const Voxel& voxel, float mm) {
    const auto step_mm = static_cast<float>(mask_.geometry.spacing_mm);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const float voxels = std::sqrt(static_cast<float>(dx * dx + dy * dy + dz * dz));
          const Voxel to = {voxel[0] + dx, voxel[1] + dy, voxel[2] + dz};
          const float to_mm = mm + step_mm * voxels;
          // What is near already is most of it, and is asked first.
          if (IsNearer(to, to_mm) && IsOpen(voxel, {dx, dy, dz})) Put(to, to_mm);
        }
      }
    }
  }

  // Whether all voxels of the block from a voxel to its neighbour lie in the mask, but the first.
  bool IsOpen(const Voxel& from, const Voxel& step) const {
    for (unsigned corner = 1; corner < 8; ++corner) {
      Voxel at = from;
      for (unsigned axis = 0; axis < 3; ++axis) {
        if ((corner >> axis & 1U) != 0) at[axis] += step[axis];
      }
      if (at == from) continue;
      const auto [x, y, z] = at;
      if (!mask_.geometry.Contains(x, y, z) || mask_.At(x, y, z) == 0) return false;
    }
    return true;
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

LabelGrid AirReachedByBall(const LabelGrid& air, double radius_mm) {
  const int padding = static_cast<int>(std::ceil(radius_mm / air.geometry.spacing_mm)) + 2;
  const LabelGrid padded = Padded(air, padding);
  const LabelGrid tissue = MaskWhere(padded, [](uint8_t value) { return value == 0; });
  const LabelGrid free = MaskWhere(DistanceMm(tissue), [=](float mm) { return mm > radius_mm; });
  const LabelGrid centres = LargestComponent(free, Neighbours::kFaces);
  const LabelGrid reached =
      MaskWhere(DistanceMm(centres), [=](float mm) { return mm <= radius_mm; });
  VoxelBox inner;
  for (size_t axis = 0; axis < 3; ++axis) {
    inner.first[axis] = padding;
    inner.last[axis] = padding + air.geometry.size[axis] - 1;
  }
  return Both(air, Crop(reached, inner));
}

LabelGrid OutsideAir(const HeadSegmentation& head, const OuterSkinOptions& options) {
  const LabelGrid air =
      MaskWhere(head.hu, [&](int16_t hu) { return hu <= head.options.tissue_above_hu; });
  const LabelGrid reached = AirReachedByBall(air, options.opening_radius_mm);
  return MaskWhere(DistanceWithin(air, reached, options.crease_mm),
                   [](float mm) { return std::isfinite(mm); });
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
