// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/skin_distance.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <Eigen/Geometry>

#include "core/base/percentiles.h"
#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

// Farther than four voxels a crossing is that of another surface (the other side of a lip); an
// eighth is fine enough that a linear step between two samples is exact to well under a hundredth
// of a voxel.
constexpr double kSearchVoxels = 4;
constexpr double kStepVoxels = 0.125;

// Mean of the triangles' normals, weighted by their areas.
Positions VertexNormals(const TriangleMesh& surface) {
  Positions normals = Positions::Zero(surface.num_vertices(), 3);
  for (const auto& triangle : surface.triangles().rowwise()) {
    const Eigen::Vector3d a = surface.positions().row(triangle[0]);
    const Eigen::Vector3d b = surface.positions().row(triangle[1]);
    const Eigen::Vector3d c = surface.positions().row(triangle[2]);
    const Eigen::RowVector3d area = (b - a).cross(c - a).transpose();
    for (const int32_t v : triangle) normals.row(v) += area;
  }
  normals.rowwise().normalize();
  return normals;
}

// Steps from the place along the direction; where between two steps the value crosses the threshold
// the line between them decides.
std::optional<double> CrossingMm(const HuGrid& hu, double threshold_hu,
                                 const Eigen::Vector3d& place, const Eigen::Vector3d& direction) {
  const double step = kStepVoxels * hu.geometry.spacing_mm;
  double before = Interpolate(hu, place) - threshold_hu;
  if (before == 0) return 0.0;
  for (int i = 1; i * kStepVoxels <= kSearchVoxels; ++i) {
    const double here = Interpolate(hu, place + i * step * direction) - threshold_hu;
    if ((here > 0) != (before > 0)) return step * (i - 1 + before / (before - here));
    before = here;
  }
  return std::nullopt;
}

void Summarize(SkinDistance* distance) {
  std::vector<double> sorted = distance->mm;
  if (sorted.empty()) return;
  std::sort(sorted.begin(), sorted.end());
  distance->mean_mm =
      std::accumulate(sorted.begin(), sorted.end(), 0.0) / static_cast<double>(sorted.size());
  distance->p99_mm = PercentileOfRising(sorted, 99);
  distance->max_mm = sorted.back();
}

}  // namespace

SkinDistance MeasureSkinDistance(const TriangleMesh& surface, const std::vector<bool>& on_skin,
                                 const HuGrid& hu, double threshold_hu) {
  const Positions normals = VertexNormals(surface);
  SkinDistance distance;
  for (Eigen::Index v = 0; v < surface.num_vertices(); ++v) {
    if (!on_skin[static_cast<size_t>(v)]) continue;
    const Eigen::Vector3d place = surface.positions().row(v);
    const Eigen::Vector3d normal = normals.row(v);
    const std::optional<double> outwards = CrossingMm(hu, threshold_hu, place, normal);
    const std::optional<double> inwards = CrossingMm(hu, threshold_hu, place, -normal);
    if (!outwards && !inwards) {
      ++distance.not_found;
      continue;
    }
    const double nearest = std::min(outwards.value_or(HUGE_VAL), inwards.value_or(HUGE_VAL));
    distance.mm.push_back(nearest);
  }
  Summarize(&distance);
  return distance;
}

}  // namespace tissueform
