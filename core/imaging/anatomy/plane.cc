// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"

namespace tissueform {
namespace {

// What has no counterpart within this counts the same however far off it is, so that a missing
// tooth, a metal streak or the CT's border does not drag the plane along.
constexpr double kFarthestMm = 6;
constexpr size_t kSamples = 4000;
constexpr double kFirstStep = 8;  // degrees, and mm
constexpr double kLastStep = 0.25;

std::vector<Eigen::Vector3d> SamplePlaces(const LabelGrid& mask) {
  const size_t every = std::max<size_t>(1, static_cast<size_t>(CountVoxels(mask)) / kSamples);
  std::vector<Eigen::Vector3d> places;
  size_t count = 0;
  ForEachVoxel(mask, [&](size_t, const Eigen::Vector3d& place) {
    if (count++ % every == 0) places.push_back(place);
  });
  return places;
}

Eigen::Vector3d Mean(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place : places) sum += place;
  return sum / static_cast<double>(places.size());
}

// Turned by [0] degrees about z and [1] about y, moved by [2] mm along x.
Plane MovedPlane(const Eigen::Vector3d& middle, const std::array<double, 3>& movement) {
  constexpr double kRadians = std::numbers::pi / 180;
  const Eigen::Vector3d normal =
      Eigen::AngleAxisd(movement[0] * kRadians, Eigen::Vector3d::UnitZ()) *
      (Eigen::AngleAxisd(movement[1] * kRadians, Eigen::Vector3d::UnitY()) *
       Eigen::Vector3d::UnitX());
  return {middle + movement[2] * Eigen::Vector3d::UnitX(), normal};
}

double MeanMirrorDistance(const std::vector<Eigen::Vector3d>& places, const FloatGrid& distance,
                          const Plane& plane) {
  double sum = 0;
  for (const Eigen::Vector3d& place : places) {
    const Eigen::Vector3d mirrored = place - 2 * plane.HeightMm(place) * plane.normal;
    const Eigen::Vector3d voxel = distance.geometry.ToVoxels(mirrored);
    const auto x = static_cast<int>(std::lround(voxel.x()));
    const auto y = static_cast<int>(std::lround(voxel.y()));
    const auto z = static_cast<int>(std::lround(voxel.z()));
    const double mm = distance.geometry.Contains(x, y, z) ? distance.At(x, y, z) : kFarthestMm;
    sum += std::min(kFarthestMm, mm);
  }
  return sum / static_cast<double>(places.size());
}

}  // namespace

// A search along the three coordinates with steps that halve when none helps: the sum has no
// derivative, as distances are looked up by whole voxels. Two of the first steps, 16 degrees and
// 16 mm, are as much as a head lies askew in a scanner.
Plane FindSymmetryPlane(const LabelGrid& mask, double start_x_mm) {
  const std::vector<Eigen::Vector3d> places = SamplePlaces(mask);
  const FloatGrid distance = DistanceMm(mask);
  Eigen::Vector3d middle = Mean(places);
  middle.x() = start_x_mm;
  std::array<double, 3> best = {0, 0, 0};
  double least = MeanMirrorDistance(places, distance, MovedPlane(middle, best));
  for (double step = kFirstStep; step >= kLastStep;) {
    const double before = least;
    for (size_t axis = 0; axis < 3; ++axis) {
      for (const double change : {-step, step}) {
        std::array<double, 3> moved = best;
        moved[axis] += change;
        const double mean_mm = MeanMirrorDistance(places, distance, MovedPlane(middle, moved));
        if (mean_mm >= least) continue;
        least = mean_mm;
        best = moved;
      }
    }
    if (least >= before) step /= 2;
  }
  return MovedPlane(middle, best);
}

double LeastHeightMm(const std::vector<Plane>& planes, const Eigen::Vector3d& place) {
  double least = std::numeric_limits<double>::infinity();
  for (const Plane& plane : planes) least = std::min(least, plane.HeightMm(place));
  return least;
}

}  // namespace tissueform
