// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_generation/cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;

// From how many triangles of its wall a cavity is looked at.
constexpr size_t kMostViews = 24;

struct Component {
  std::vector<Eigen::Index> triangles;
  double volume_mm3 = 0;  // signed
};

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

std::vector<Component> ComponentsOf(const TriangleMesh& surface) {
  const ConnectedComponents connected =
      FindConnectedComponents(surface.triangles(), surface.num_vertices());
  std::vector<Component> components(static_cast<size_t>(connected.count));
  const Vector3d origin = surface.positions().row(0).transpose();
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    Component& component = components[connected.component_of_vertex[surface.triangles()(f, 0)]];
    const auto [a, b, c] = CornersOf(surface, f);
    component.triangles.push_back(f);
    component.volume_mm3 += (a - origin).dot((b - origin).cross(c - origin)) / 6;
  }
  return components;
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
std::vector<Eigen::Index> Views(const TriangleMesh& surface, const Component& wall) {
  std::vector<Eigen::Index> views = wall.triangles;
  const auto area = [&](Eigen::Index f) { return NormalOf(CornersOf(surface, f)).squaredNorm(); };
  std::stable_sort(views.begin(), views.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return area(a) > area(b); });
  views.resize(std::min(views.size(), kMostViews));
  return views;
}

Vector3d PointInside(const TriangleMesh& surface, const Component& wall, double facing) {
  Vector3d point = Vector3d::Zero();
  double widest = 0;
  for (const Eigen::Index view : Views(surface, wall)) {
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
  const std::vector<Component> components = ComponentsOf(surface);
  const auto outer = std::max_element(components.begin(), components.end(),
                                      [](const Component& a, const Component& b) {
                                        return std::abs(a.volume_mm3) < std::abs(b.volume_mm3);
                                      });
  const double facing = outer->volume_mm3 > 0 ? 1 : -1;
  std::vector<Vector3d> points;
  for (const Component& component : components) {
    if (component.volume_mm3 * facing >= 0) continue;
    points.push_back(PointInside(surface, component, facing));
  }
  return points;
}

}  // namespace tissueform
