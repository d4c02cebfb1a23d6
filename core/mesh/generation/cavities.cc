// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/mesh/surface_parts.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;

// From how many triangles of its wall a cavity is looked at. A ray looks at every triangle, without
// a search tree; the number keeps that linear in the size of the surface.
constexpr size_t kMaxViews = 24;

Corners CornersOf(const TriangleMesh& surface, Eigen::Index triangle) {
  Corners corners;
  for (int k = 0; k < 3; ++k) {
    corners[k] = surface.positions().row(surface.triangles()(triangle, k)).transpose();
  }
  return corners;
}

// Twice the area as its length.
Vector3d NormalOf(const Corners& corners) {
  return (corners[1] - corners[0]).cross(corners[2] - corners[0]);
}

// How far along `direction` the ray from `from` meets the triangle, or infinity. Edges belong to
// the triangle: no ray slips between two of them.
double DistanceTo(const Corners& corners, const Vector3d& from, const Vector3d& direction) {
  constexpr double kSlack = 1e-9;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d system;
  system << corners[1] - corners[0], corners[2] - corners[0], -direction;
  if (system.determinant() == 0) return kNever;
  const Vector3d solution = system.inverse() * (from - corners[0]);
  const bool is_inside =
      solution[0] >= -kSlack && solution[1] >= -kSlack && solution[0] + solution[1] <= 1 + kSlack;
  return is_inside && solution[2] > 0 ? solution[2] : kNever;
}

// The largest triangles of a wall: the rays from them start well away from edges.
std::vector<Eigen::Index> Views(const TriangleMesh& surface, const SurfaceParts& parts,
                                int32_t wall) {
  std::vector<Eigen::Index> views;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    if (parts.part_of_triangle[f] == wall) views.push_back(f);
  }
  const auto area = [&](Eigen::Index f) { return NormalOf(CornersOf(surface, f)).squaredNorm(); };
  std::stable_sort(views.begin(), views.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return area(a) > area(b); });
  views.resize(std::min(views.size(), kMaxViews));
  return views;
}

// A normal of the wall points into the cavity, and up to the first triangle that the ray meets,
// whether of the wall or of a part inside, there is nothing but cavity. Halfway along the widest of
// these gaps there is the most room for rounding.
Vector3d PointInside(const TriangleMesh& surface, const std::vector<Eigen::Index>& views,
                     double facing) {
  Vector3d point = Vector3d::Zero();
  double widest = 0;
  for (const Eigen::Index view : views) {
    const Corners corners = CornersOf(surface, view);
    const Vector3d from = (corners[0] + corners[1] + corners[2]) / 3;
    const Vector3d direction = facing * NormalOf(corners).normalized();
    double gap = std::numeric_limits<double>::infinity();
    for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
      if (f != view) gap = std::min(gap, DistanceTo(CornersOf(surface, f), from, direction));
    }
    if (!std::isfinite(gap) || gap <= widest) continue;
    widest = gap;
    point = from + 0.5 * gap * direction;
  }
  return point;
}

}  // namespace

std::vector<Vector3d> CavityPoints(const TriangleMesh& surface) {
  const SurfaceParts parts = FindSurfaceParts(surface);
  const std::vector<double>& volumes = parts.volumes_mm3;
  const auto outer = std::max_element(volumes.begin(), volumes.end(),
                                      [](double a, double b) { return std::abs(a) < std::abs(b); });
  const double facing = *outer > 0 ? 1 : -1;
  std::vector<Vector3d> points;
  for (size_t part = 0; part < volumes.size(); ++part) {
    if (volumes[part] * facing >= 0) continue;
    const auto wall = static_cast<int32_t>(part);
    points.push_back(PointInside(surface, Views(surface, parts, wall), facing));
  }
  return points;
}

}  // namespace tissueform
