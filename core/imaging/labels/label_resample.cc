// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_resample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/LU>

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

// Places of the samples in a voxel of the grid, in mm from its centre.
std::vector<Eigen::Vector3d> SamplesOf(double voxel_mm, const Eigen::Vector3d& map_spacing_mm) {
  // Rounding of spacings must not make a grid "finer" than its equal. Odd numbers: a tie at one
  // half would make all structures larger.
  const double ratio = voxel_mm / map_spacing_mm.minCoeff() - 1e-3;
  const int count = ratio <= 1 ? 1 : ratio <= 3 ? 3 : 5;
  const auto place = [&](int i) { return voxel_mm * ((i + 0.5) / count - 0.5); };
  std::vector<Eigen::Vector3d> samples;
  for (int z = 0; z < count; ++z) {
    for (int y = 0; y < count; ++y) {
      for (int x = 0; x < count; ++x) samples.emplace_back(place(x), place(y), place(z));
    }
  }
  return samples;
}

class Sampler {
 public:
  Sampler(const LabelMap& map, double voxel_mm)
      : map_(map),
        to_map_(map.steps_mm.inverse()),
        samples_(SamplesOf(voxel_mm, map.steps_mm.colwise().norm())) {
    for (Eigen::Vector3d& sample : samples_) sample = to_map_ * sample;
  }

  // Of the voxel of the map that holds the place; nullopt outside of all.
  std::optional<StructureSet> At(const Eigen::Vector3d& index) const {
    std::array<int64_t, 3> voxel{};
    for (size_t axis = 0; axis < 3; ++axis) {
      voxel[axis] = std::llround(index[static_cast<Eigen::Index>(axis)]);
      if (voxel[axis] < 0 || voxel[axis] >= map_.size[axis]) return std::nullopt;
    }
    return map_.structures[static_cast<size_t>(
        voxel[0] + map_.size[0] * (voxel[1] + map_.size[1] * voxel[2]))];
  }

  Eigen::Vector3d IndexOf(const Eigen::Vector3d& place_mm) const {
    return to_map_ * (place_mm - map_.origin_mm);
  }

  // What fills more than half of a voxel about `index`.
  StructureSet Filling(const Eigen::Vector3d& index) const {
    if (samples_.size() == 1) return At(index).value_or(0);
    std::array<size_t, kNumStructures> counts{};
    for (const Eigen::Vector3d& sample : samples_) {
      const StructureSet set = At(index + sample).value_or(0);
      if (set == 0) continue;
      for (size_t s = 0; s < counts.size(); ++s) counts[s] += set >> s & 1U;
    }
    StructureSet filling = 0;
    for (size_t s = 0; s < counts.size(); ++s) {
      if (2 * counts[s] > samples_.size()) filling |= SetOf(static_cast<Structure>(s));
    }
    return filling;
  }

 private:
  const LabelMap& map_;
  Eigen::Matrix3d to_map_;
  std::vector<Eigen::Vector3d> samples_;
};

}  // namespace

LabelledGrid ResampleLabels(const LabelMap& map, const GridGeometry& grid, int threads) {
  LabelledGrid result;
  result.structures = VoxelGrid<StructureSet>(grid);
  result.covered = LabelGrid(grid);
  result.voxel_mm = std::max(grid.spacing_mm, map.steps_mm.colwise().norm().maxCoeff());
  const Sampler sampler(map, grid.spacing_mm);
  const auto fill_row = [&](int y, int z) {
    for (int x = 0; x < grid.size[0]; ++x) {
      const Eigen::Vector3d index = sampler.IndexOf(grid.Centre(x, y, z));
      if (!sampler.At(index)) continue;
      result.covered.At(x, y, z) = 1;
      result.structures.At(x, y, z) = sampler.Filling(index);
    }
  };
  ParallelFor(threads, grid.size[2], 1, [&](Eigen::Index begin, Eigen::Index end) {
    for (auto z = static_cast<int>(begin); z < static_cast<int>(end); ++z) {
      for (int y = 0; y < grid.size[1]; ++y) fill_row(y, z);
    }
  });
  return result;
}

}  // namespace tissueform
