// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/surface_parts.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

std::array<Vector3d, 3> CornersFrom(const TriangleMesh& surface, Eigen::Index triangle,
                                    const Vector3d& origin) {
  std::array<Vector3d, 3> corners;
  for (int k = 0; k < 3; ++k) {
    corners[k] = surface.positions().row(surface.triangles()(triangle, k)).transpose() - origin;
  }
  return corners;
}

// atan2 and not atan: the denominator is negative where a triangle fills more than a quarter of the
// view, as it does for a point close to it.
double SolidAngle(const std::array<Vector3d, 3>& corners) {
  const auto& [a, b, c] = corners;
  const double la = a.norm();
  const double lb = b.norm();
  const double lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

SurfaceParts FindSurfaceParts(const TriangleMesh& surface) {
  const ConnectedComponents components =
      FindConnectedComponents(surface.triangles(), surface.num_vertices());
  SurfaceParts parts;
  parts.volumes_mm3.resize(static_cast<size_t>(components.count));
  const Vector3d origin = surface.positions().row(0).transpose();
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    const int32_t part = components.component_of_vertex[surface.triangles()(f, 0)];
    const auto [a, b, c] = CornersFrom(surface, f, origin);
    parts.volumes_mm3[part] += a.dot(b.cross(c)) / 6;
    parts.part_of_triangle.push_back(part);
  }
  return parts;
}

double WindingNumber(const TriangleMesh& surface, const SurfaceParts& parts,
                     const std::vector<bool>& chosen, const Vector3d& point) {
  double angle = 0;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    if (!chosen[parts.part_of_triangle[f]]) continue;
    angle += SolidAngle(CornersFrom(surface, f, point));
  }
  return angle / (4 * std::numbers::pi);
}

TriangleMesh KeepParts(const TriangleMesh& surface, const SurfaceParts& parts,
                       const std::vector<bool>& kept) {
  std::vector<int32_t> number(static_cast<size_t>(surface.num_vertices()), -1);
  TriangleIndices triangles(surface.num_triangles(), 3);
  Eigen::Index num_triangles = 0;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    if (!kept[parts.part_of_triangle[f]]) continue;
    triangles.row(num_triangles++) = surface.triangles().row(f);
    for (int k = 0; k < 3; ++k) number[surface.triangles()(f, k)] = 0;
  }
  triangles.conservativeResize(num_triangles, 3);
  Positions positions(surface.num_vertices(), 3);
  int32_t num_vertices = 0;
  for (Eigen::Index v = 0; v < surface.num_vertices(); ++v) {
    if (number[v] < 0) continue;
    positions.row(num_vertices) = surface.positions().row(v);
    number[v] = num_vertices++;
  }
  positions.conservativeResize(num_vertices, 3);
  for (int32_t& v : triangles.reshaped<Eigen::RowMajor>()) v = number[v];
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

}  // namespace tissueform
