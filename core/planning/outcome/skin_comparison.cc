// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/skin_comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/Geometry>

#include "core/mesh/nearest_point.h"
#include "core/mesh/skin_region.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// Farther from the predicted face is another part of the head.
constexpr double kReachMm = 15;
constexpr double kWhollyOnBorder = 1 - 1e-6;

Positions VertexNormals(const TriangleMesh& mesh) {
  Positions normals = Positions::Zero(mesh.num_vertices(), 3);
  for (const auto& t : mesh.triangles().rowwise()) {
    for (int k = 0; k < 3; ++k) {
      const Vector3d at = mesh.positions().row(t[k]);
      const Vector3d a = mesh.positions().row(t[(k + 1) % 3]).transpose() - at;
      const Vector3d b = mesh.positions().row(t[(k + 2) % 3]).transpose() - at;
      const Vector3d normal = a.cross(b);
      const double angle = std::atan2(normal.norm(), a.dot(b));
      if (normal.norm() > 0) normals.row(t[k]) += angle * normal.normalized().transpose();
    }
  }
  normals.rowwise().normalize();
  return normals;
}

// Vertices of edges that have one triangle.
std::vector<bool> BorderVertices(const TriangleMesh& mesh) {
  std::map<std::pair<int32_t, int32_t>, int> triangles_of_edge;
  for (const auto& t : mesh.triangles().rowwise()) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = t[k];
      const int32_t b = t[(k + 1) % 3];
      ++triangles_of_edge[{std::min(a, b), std::max(a, b)}];
    }
  }
  std::vector<bool> on_border(static_cast<size_t>(mesh.num_vertices()), false);
  for (const auto& [edge, count] : triangles_of_edge) {
    if (count != 1) continue;
    on_border[static_cast<size_t>(edge.first)] = true;
    on_border[static_cast<size_t>(edge.second)] = true;
  }
  return on_border;
}

// The region 0 stands for all.
std::string NameOf(uint8_t region) {
  return region == 0 ? "face" : std::string(SkinRegionName(static_cast<SkinRegion>(region)));
}

struct OneWay {
  std::array<AreaDistances, 7> regions;  // by number; all in 0
  std::array<double, 7> area_mm2 = {};   // also of what is not compared
};

void Add(uint8_t region, double mm, double area_mm2, bool compared, OneWay* way) {
  for (const size_t r : {size_t{0}, static_cast<size_t>(region)}) {
    way->area_mm2[r] += area_mm2;
    if (!compared) continue;
    way->regions[r].mm.push_back(mm);
    way->regions[r].area_mm2.push_back(area_mm2);
  }
}

std::vector<int32_t> VerticesWithRegion(const ComparedFace& face) {
  std::vector<int32_t> vertices;
  for (size_t v = 0; v < face.regions.size(); ++v) {
    if (face.regions[v] != 0) vertices.push_back(static_cast<int32_t>(v));
  }
  return vertices;
}

OneWay FromPredicted(const ComparedFace& predicted, const SignedSurface& real) {
  const std::vector<int32_t> vertices = VerticesWithRegion(predicted);
  const Eigen::VectorXd areas = VertexAreas(predicted.positions, predicted.triangles);
  const SignedDistances found = real.Of(predicted.positions(vertices, Eigen::all));
  OneWay way;
  for (size_t i = 0; i < vertices.size(); ++i) {
    const double mm = -found.mm[static_cast<Index>(i)];
    const bool compared = !found.beyond_border[i] && std::abs(mm) <= kReachMm;
    Add(predicted.regions[static_cast<size_t>(vertices[i])], mm, areas[vertices[i]], compared,
        &way);
  }
  return way;
}

// Vertices of the operated face in the box of the compared part of the predicted one.
std::vector<int32_t> NearbyVertices(const ComparedFace& predicted, const TriangleMesh& real) {
  Eigen::AlignedBox3d box;
  for (const int32_t v : VerticesWithRegion(predicted)) {
    box.extend(predicted.positions.row(v).transpose());
  }
  std::vector<int32_t> nearby;
  if (box.isEmpty()) return nearby;
  for (Index v = 0; v < real.num_vertices(); ++v) {
    if (box.exteriorDistance(Vector3d(real.positions().row(v))) <= kReachMm) {
      nearby.push_back(static_cast<int32_t>(v));
    }
  }
  return nearby;
}

OneWay FromReal(const ComparedFace& predicted, const TriangleMesh& real) {
  const SignedSurface surface(*TriangleMesh::Create(predicted.positions, predicted.triangles));
  const std::vector<int32_t> vertices = NearbyVertices(predicted, real);
  const Eigen::VectorXd areas = VertexAreas(real.positions(), real.triangles());
  const SignedDistances found = surface.Of(real.positions()(vertices, Eigen::all));
  OneWay way;
  for (size_t i = 0; i < vertices.size(); ++i) {
    const uint8_t region = predicted.regions[static_cast<size_t>(found.vertex[i])];
    const double mm = found.mm[static_cast<Index>(i)];
    if (region == 0 || std::abs(mm) > kReachMm) continue;
    Add(region, mm, areas[vertices[i]], !found.beyond_border[i], &way);
  }
  return way;
}

}  // namespace

SignedSurface::SignedSurface(const TriangleMesh& surface)
    : mesh_(surface),
      nearest_(surface),
      normals_(VertexNormals(surface)),
      on_border_(BorderVertices(surface)) {}

SignedDistances SignedSurface::Of(const Positions& points) const {
  const SurfacePoints nearest = nearest_.WithNormals(points);
  SignedDistances result{.mm = Eigen::VectorXd(points.rows()), .beyond_border = {}, .vertex = {}};
  for (Index p = 0; p < points.rows(); ++p) {
    const auto t = mesh_.triangles().row(nearest.triangles[static_cast<size_t>(p)]);
    const Vector3d at = nearest.points.row(p);
    const Vector3d shares = NearestShares(at, mesh_.positions().row(t[0]),
                                          mesh_.positions().row(t[1]), mesh_.positions().row(t[2]));
    Vector3d normal = Vector3d::Zero();
    double border = 0;
    for (int k = 0; k < 3; ++k) {
      normal += shares[k] * normals_.row(t[k]).transpose();
      if (on_border_[static_cast<size_t>(t[k])]) border += shares[k];
    }
    const Vector3d way = points.row(p).transpose() - at;
    result.mm[p] = way.dot(normal) < 0 ? -way.norm() : way.norm();
    result.beyond_border.push_back(border > kWhollyOnBorder);
    Index corner = 0;
    shares.maxCoeff(&corner);
    result.vertex.push_back(t[corner]);
  }
  return result;
}

Eigen::VectorXd VertexAreas(const Positions& positions, const TriangleIndices& triangles) {
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(positions.rows());
  for (const auto& t : triangles.rowwise()) {
    const Vector3d a = positions.row(t[0]);
    const Vector3d b = positions.row(t[1]);
    const Vector3d c = positions.row(t[2]);
    const double third = (b - a).cross(c - a).norm() / 6;
    for (const int32_t corner : t) areas[corner] += third;
  }
  return areas;
}

std::vector<RegionComparison> CompareFaces(const ComparedFace& predicted,
                                           const SignedSurface& real) {
  const OneWay from_predicted = FromPredicted(predicted, real);
  const OneWay from_real = FromReal(predicted, real.mesh());
  std::vector<RegionComparison> comparisons;
  for (const uint8_t region : {1, 2, 3, 4, 5, 6, 0}) {
    if (from_predicted.area_mm2[region] <= 0) continue;
    RegionComparison comparison;
    comparison.region = NameOf(region);
    comparison.predicted_to_real = Summarize(from_predicted.regions[region]);
    comparison.real_to_predicted = Summarize(from_real.regions[region]);
    comparison.compared_share =
        100 * comparison.predicted_to_real.area_cm2 / from_predicted.area_mm2[region];
    comparisons.push_back(std::move(comparison));
  }
  return comparisons;
}

Eigen::VectorXd DistanceMap(const ComparedFace& predicted, const SignedSurface& real) {
  const std::vector<int32_t> vertices = VerticesWithRegion(predicted);
  const SignedDistances found = real.Of(predicted.positions(vertices, Eigen::all));
  Eigen::VectorXd map = Eigen::VectorXd::Constant(predicted.positions.rows(),
                                                  std::numeric_limits<double>::quiet_NaN());
  for (size_t i = 0; i < vertices.size(); ++i) {
    if (!found.beyond_border[i]) map[vertices[i]] = -found.mm[static_cast<Index>(i)];
  }
  return map;
}

}  // namespace tissueform
