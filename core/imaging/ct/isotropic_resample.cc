// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/isotropic_resample.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/base/parallel_for.h"
#include "core/imaging/ct/uneven_slices.h"
#include "core/imaging/ct/upright_resample.h"

namespace tissueform {
namespace {

constexpr int16_t kAir = -1024;
constexpr double kLeastSpacingMm = 0.1;
constexpr double kMaxSpacingMm = 10;
// Along an axis: 512 samples a voxel bound the time; beyond that more would hardly change a mean.
constexpr int kMaxSamples = 8;
constexpr double kRounding = 1e-6;  // of a voxel

using Samples = std::array<int, 3>;

// Box of the volume's voxels, upright in the patient.
Eigen::AlignedBox3d BoxOf(const CtVolume& volume) {
  if (!volume.slice_origins_mm.empty()) return UnevenSlices(volume).Box();
  const Eigen::Matrix3d steps = volume.StepsMm();
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d index;
    for (int axis = 0; axis < 3; ++axis) {
      const bool far = ((corner >> axis) & 1) != 0;
      index[axis] = far ? volume.size[static_cast<size_t>(axis)] - 0.5 : -0.5;
    }
    box.extend(volume.origin_mm + steps * index);
  }
  return box;
}

GridGeometry GridOver(const Eigen::AlignedBox3d& box, double spacing_mm) {
  GridGeometry grid;
  grid.spacing_mm = spacing_mm;
  for (int axis = 0; axis < 3; ++axis) {
    const double count = std::max(1.0, std::round(box.sizes()[axis] / spacing_mm));
    grid.size[static_cast<size_t>(axis)] = static_cast<int>(std::min(count, 1e6));
    grid.origin_mm[axis] = box.center()[axis] - (count - 1) / 2 * spacing_mm;
  }
  return grid;
}

// Into voxels of the volume; where slices lie unevenly the third counts smallest gaps, and only its
// scale is used.
Eigen::Matrix3d ToIndex(const CtVolume& volume) {
  Eigen::Matrix3d steps = volume.StepsMm();
  if (!volume.slice_origins_mm.empty()) {
    steps.col(2) = volume.direction.col(2) * UnevenSlices(volume).smallest_gap_mm();
  }
  return steps.inverse();
}

// As many as the volume's own voxels under one of the grid's, so that none is passed over: sampled
// at its centre alone, a coarse grid would show the noise of one voxel in several, and thin bone or
// not by chance (aliasing).
Samples SamplesPerVoxel(const Eigen::Matrix3d& to_index, double spacing_mm) {
  Samples samples{};
  for (int axis = 0; axis < 3; ++axis) {
    const double source_voxels = to_index.col(axis).cwiseAbs().maxCoeff() * spacing_mm;
    samples[static_cast<size_t>(axis)] =
        std::clamp(static_cast<int>(std::ceil(source_voxels - kRounding)), 1, kMaxSamples);
  }
  return samples;
}

// Whether a place, in voxels of the volume, lies in its box: half a voxel beyond the outermost
// centres.
bool LiesInVolume(const Eigen::Vector3d& place, const std::array<int, 3>& size) {
  for (int axis = 0; axis < 3; ++axis) {
    const double end = size[static_cast<size_t>(axis)] - 0.5;
    if (!(place[axis] >= -0.5 - kRounding && place[axis] <= end + kRounding)) return false;
  }
  return true;
}

SamplePlaces PlacesOf(const CtVolume& volume, const GridGeometry& grid) {
  const Eigen::Matrix3d to_index = ToIndex(volume);
  return {.start = to_index * (grid.origin_mm - volume.origin_mm),
          .steps = to_index * grid.spacing_mm,
          .size = grid.size,
          .samples = SamplesPerVoxel(to_index, grid.spacing_mm),
          .rounding = kRounding,
          .beyond = kAir};
}

// Samples each place by itself, as volumes need that are turned, sheared or of uneven slices.
class Sampler {
 public:
  Sampler(const CtVolume& volume, const GridGeometry& grid)
      : volume_(volume), grid_(grid), places_(PlacesOf(volume, grid)) {
    if (!volume.slice_origins_mm.empty()) uneven_.emplace(volume);
  }

  void FillSlice(int z, int16_t* values) const {
    for (int y = 0; y < grid_.size[1]; ++y) {
      for (int x = 0; x < grid_.size[0]; ++x) *values++ = Mean(x, y, z);
    }
  }

  // Over voxel (x, y, z) of the grid, of the samples that lie in the volume.
  int16_t Mean(int x, int y, int z) const {
    double sum = 0;
    int count = 0;
    for (int c = 0; c < places_.samples[2]; ++c) {
      for (int b = 0; b < places_.samples[1]; ++b) {
        for (int a = 0; a < places_.samples[0]; ++a) {
          const Eigen::Vector3d place(x + places_.Offset(a, 0), y + places_.Offset(b, 1),
                                      z + places_.Offset(c, 2));
          const bool inside = uneven_ ? AddUnevenSample(place, &sum)
                                      : AddSample(places_.start + places_.steps * place, &sum);
          count += inside ? 1 : 0;
        }
      }
    }
    return count == 0 ? kAir : static_cast<int16_t>(std::lround(sum / count));
  }

 private:
  bool AddSample(const Eigen::Vector3d& index, double* sum) const {
    if (!LiesInVolume(index, volume_.size)) return false;
    *sum += VoxelCell(index, volume_.size).Mean([this](int i, int j, int k) {
      return static_cast<double>(volume_.At(i, j, k));
    });
    return true;
  }

  // `place` in voxels of the grid.
  bool AddUnevenSample(const Eigen::Vector3d& place, double* sum) const {
    const std::optional<double> value =
        uneven_->ValueAt(grid_.origin_mm + grid_.spacing_mm * place);
    *sum += value.value_or(0);
    return value.has_value();
  }

  const CtVolume& volume_;
  const GridGeometry& grid_;
  SamplePlaces places_;
  std::optional<UnevenSlices> uneven_;
};

absl::Status CheckRequest(const Eigen::AlignedBox3d& box, double spacing_mm, int64_t max_bytes) {
  if (!(spacing_mm >= kLeastSpacingMm && spacing_mm <= kMaxSpacingMm)) {
    return absl::InvalidArgumentError(absl::StrCat("a spacing of ", spacing_mm, " mm is not in [",
                                                   kLeastSpacingMm, ", ", kMaxSpacingMm, "] mm"));
  }
  const Eigen::Vector3d counts = (box.sizes() / spacing_mm).array().round().max(1.0);
  const double bytes = counts.prod() * sizeof(int16_t);
  if (!(bytes <= static_cast<double>(max_bytes)) || counts.maxCoeff() > 1e6) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "the volume at a spacing of ", spacing_mm, " mm needs ", bytes,
        " bytes of memory; at most ", max_bytes, " are given: choose a larger spacing"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<HuGrid> ResampleIsotropic(const CtVolume& volume, double spacing_mm,
                                         const ResampleOptions& options) {
  const Eigen::AlignedBox3d box = BoxOf(volume);
  const absl::Status possible = CheckRequest(box, spacing_mm, options.max_bytes);
  if (!possible.ok()) return possible;
  HuGrid grid(GridOver(box, spacing_mm));
  const Sampler sampler(volume, grid.geometry);
  const std::optional<UprightResampler> upright =
      UprightResampler::Create(volume, PlacesOf(volume, grid.geometry));
  const auto mean = [&sampler](int x, int y, int z) { return sampler.Mean(x, y, z); };
  const Eigen::Index slice = Eigen::Index{grid.geometry.size[0]} * grid.geometry.size[1];
  const auto fill = [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index z = begin; z < end; ++z) {
      int16_t* const values = grid.values.data() + z * slice;
      if (upright) {
        upright->FillSlice(static_cast<int>(z), mean, values);
      } else {
        sampler.FillSlice(static_cast<int>(z), values);
      }
    }
  };
  ParallelFor(options.threads, grid.geometry.size[2], 1, fill);
  return grid;
}

}  // namespace tissueform
