// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/upright_resample.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace tissueform {
namespace {

// Far more than sums of HU are rounded by.
constexpr double kTie = 1e-6;

bool IsTie(double sum) { return std::abs(sum - std::floor(sum) - 0.5) < kTie; }

// to[i] += weight * from[i * stride].
void AddLine(const int16_t* from, ptrdiff_t stride, double weight, ptrdiff_t size, double* to) {
  if (stride == 1) {
    for (ptrdiff_t i = 0; i < size; ++i) to[i] += weight * from[i];
    return;
  }
  for (ptrdiff_t i = 0; i < size; ++i) to[i] += weight * from[i * stride];
}

// The volume's axis along which one of the grid runs, if it runs along one.
std::optional<size_t> VolumeAxis(const SamplePlaces& places, int axis) {
  Eigen::Index of_volume = 0;
  const Eigen::Vector3d step = places.steps.col(axis).cwiseAbs();
  step.maxCoeff(&of_volume);
  const double across = step.sum() - step[of_volume];
  if (across * places.size[static_cast<size_t>(axis)] > places.rounding) return std::nullopt;
  return static_cast<size_t>(of_volume);
}

}  // namespace

std::optional<UprightResampler> UprightResampler::Create(const CtVolume& volume,
                                                         const SamplePlaces& places) {
  if (!volume.slice_origins_mm.empty()) return std::nullopt;
  UprightResampler resampler(volume, places.beyond);
  for (int axis = 0; axis < 3; ++axis) {
    const std::optional<size_t> of_volume = VolumeAxis(places, axis);
    if (!of_volume) return std::nullopt;
    resampler.axes_[static_cast<size_t>(axis)] = AlongAxis(volume, places, axis, *of_volume);
  }
  return resampler;
}

UprightResampler::Axis UprightResampler::AlongAxis(const CtVolume& volume,
                                                   const SamplePlaces& places, int axis,
                                                   size_t of_volume) {
  const auto row = static_cast<Eigen::Index>(of_volume);
  const auto column = static_cast<size_t>(axis);
  const int last = volume.size[of_volume] - 1;
  Axis along{.of_volume = of_volume, .first = {}, .weights = {}};
  for (int i = 0; i < places.size[column]; ++i) {
    std::vector<std::pair<int, double>> parts;
    for (int n = 0; n < places.samples[column]; ++n) {
      const double at =
          places.start[row] + places.steps(row, axis) * (i + places.Offset(n, column));
      // The volume's box ends half a voxel beyond the outermost centres.
      if (!(at >= -0.5 - places.rounding && at <= last + 0.5 + places.rounding)) continue;
      const double inside = std::clamp(at, 0.0, static_cast<double>(last));
      const int lower = std::min(static_cast<int>(inside), std::max(0, last - 1));
      parts.emplace_back(lower, 1 - (inside - lower));
      parts.emplace_back(std::min(lower + 1, last), inside - lower);
    }
    const auto [least, most] = std::minmax_element(parts.begin(), parts.end());
    along.first.push_back(parts.empty() ? 0 : least->first);
    along.weights.emplace_back(parts.empty() ? 0 : most->first - least->first + 1, 0.0);
    for (const auto& [voxel, weight] : parts) {
      along.weights.back()[static_cast<size_t>(voxel - along.first.back())] +=
          2 * weight / static_cast<double>(parts.size());
    }
  }
  return along;
}

std::vector<double> UprightResampler::Plane(int z) const {
  const std::array<ptrdiff_t, 3> strides = {1, volume_.size[0],
                                            ptrdiff_t{volume_.size[0]} * volume_.size[1]};
  const auto size_of = [&](size_t axis) -> ptrdiff_t {
    return volume_.size[axes_[axis].of_volume];
  };
  const auto stride_of = [&](size_t axis) { return strides[axes_[axis].of_volume]; };
  std::vector<double> plane(static_cast<size_t>(size_of(0) * size_of(1)), 0.0);
  const auto slice = static_cast<size_t>(z);
  for (size_t n = 0; n < axes_[2].weights[slice].size(); ++n) {
    const int16_t* const from =
        volume_.hu.data() + (axes_[2].first[slice] + static_cast<ptrdiff_t>(n)) * stride_of(2);
    for (ptrdiff_t b = 0; b < size_of(1); ++b) {
      AddLine(from + b * stride_of(1), stride_of(0), axes_[2].weights[slice][n], size_of(0),
              plane.data() + b * size_of(0));
    }
  }
  return plane;
}

void UprightResampler::FillSlice(int z, const std::function<int16_t(int x, int y, int z)>& at_tie,
                                 int16_t* values) const {
  const std::vector<double> plane = Plane(z);
  const auto length = static_cast<size_t>(volume_.size[axes_[0].of_volume]);
  const bool is_beyond = axes_[2].weights[static_cast<size_t>(z)].empty();
  std::vector<double> row(length);
  for (size_t y = 0; y < axes_[1].first.size(); ++y) {
    const std::vector<double>& down = axes_[1].weights[y];
    std::fill(row.begin(), row.end(), 0.0);
    for (size_t n = 0; n < down.size(); ++n) {
      const double* const from =
          plane.data() + (static_cast<size_t>(axes_[1].first[y]) + n) * length;
      for (size_t i = 0; i < length; ++i) row[i] += down[n] * from[i];
    }
    for (size_t x = 0; x < axes_[0].first.size(); ++x) {
      const std::vector<double>& across = axes_[0].weights[x];
      const double* const from = row.data() + axes_[0].first[x];
      double sum = 0;
      for (size_t n = 0; n < across.size(); ++n) sum += across[n] * from[n];
      const bool none = is_beyond || down.empty() || across.empty();
      if (none) {
        *values++ = beyond_;
      } else if (IsTie(sum)) {
        *values++ = at_tie(static_cast<int>(x), static_cast<int>(y), z);
      } else {
        *values++ = static_cast<int16_t>(std::lround(sum));
      }
    }
  }
}

}  // namespace tissueform
