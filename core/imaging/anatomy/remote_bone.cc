// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/remote_bone.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

// How far it reaches is its tip's: small crowns are narrow, and 200 mm3 of one reach far down.
constexpr double kTipMm3 = 30;

// How much of a place lies beyond `limit` along a direction, for a voxel that counts as a slab as
// thick as it is wide: an extent in mm3 is then met at any depth, and not layer by layer.
double PartBeyond(double depth, double limit, double voxel_mm) {
  return std::clamp((depth - limit) / voxel_mm + 0.5, 0.0, 1.0);
}

// The depth along a direction beyond which that much of the candidates lies.
double DepthOf(double volume_mm3, double voxel_mm, const std::vector<double>& depths) {
  const auto [least, most] = std::minmax_element(depths.begin(), depths.end());
  double low = *least - voxel_mm;  // all lies beyond
  double high = *most + voxel_mm;  // nothing does
  while (high - low > 1e-3 * voxel_mm) {
    const double middle = (low + high) / 2;
    double voxels = 0;
    for (const double depth : depths) voxels += PartBeyond(depth, middle, voxel_mm);
    (voxels * voxel_mm * voxel_mm * voxel_mm > volume_mm3 ? low : high) = middle;
  }
  return low;
}

// The middle of that much of the farthest. The front teeth stand in an arch, whose middle lies
// behind them, on those of the other jaw: with `near_mm` it is moved toward what is that near to
// it.
Eigen::Vector3d MiddleBeyond(double volume_mm3, const Candidates& candidates,
                             const std::vector<double>& depths,
                             double near_mm = std::numeric_limits<double>::infinity()) {
  const double limit = DepthOf(volume_mm3, candidates.voxel_mm, depths);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  const int steps = std::isfinite(near_mm) ? 3 : 1;
  for (int step = 0; step < steps; ++step) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weight = 0;
    for (size_t i = 0; i < depths.size(); ++i) {
      double part = PartBeyond(depths[i], limit, candidates.voxel_mm);
      if (part == 0) continue;
      const double away = (candidates.places[i] - middle).squaredNorm() / (near_mm * near_mm);
      if (step > 0) part *= std::exp(-away / 2);
      sum += part * candidates.places[i];
      weight += part;
    }
    middle = sum / weight;
  }
  return middle;
}

}  // namespace

absl::Status Farthest(const Candidates& candidates, const Eigen::Vector3d& direction,
                      absl::string_view name, Eigen::Vector3d* found, const EndShape& shape) {
  if (candidates.places.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, " is not in view, or the bone there is below the threshold; check the CT's extent"));
  }
  std::vector<double> depths;
  depths.reserve(candidates.places.size());
  for (const Eigen::Vector3d& place : candidates.places) depths.push_back(direction.dot(place));
  const Eigen::Vector3d end = MiddleBeyond(shape.volume_mm3, candidates, depths, shape.near_mm);
  const Eigen::Vector3d tip = MiddleBeyond(kTipMm3, candidates, depths);
  *found = end + direction.dot(tip - end) * direction;
  return absl::OkStatus();
}

}  // namespace tissueform
