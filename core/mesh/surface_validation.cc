// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/surface_validation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include <Eigen/Geometry>

#include "core/mesh/half_edges.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/vertex_groups.h"

namespace tissueform {
namespace {

// A triangle whose area is this small against its longest edge squared has no usable normal.
constexpr double kDegenerateAreaRatio = 1e-12;

void FindBadEdges(const TriangleIndices& triangles, SurfaceReport* report) {
  std::vector<Eigen::Index> open;
  std::vector<Eigen::Index> non_manifold;
  std::vector<Eigen::Index> turned;
  ForEachEdge(triangles, [&](EdgeUses uses) {
    const int32_t vertex = uses[0].edge[0];
    if (IsOpen(uses)) open.push_back(vertex);
    if (IsNonManifold(uses)) non_manifold.push_back(vertex);
    if (IsTurned(uses)) turned.push_back(vertex);
    ++report->num_edges;
  });
  AddDefect({"open_edges", Severity::kWarning, "edges have only one triangle", "at vertex",
             "the surface is open: it has no inside to fill with tets; close it"},
            open, &report->defects);
  AddDefect({"non_manifold_edges", Severity::kWarning, "edges have three or more triangles",
             "at vertex", "the surface touches itself there; take the parts apart"},
            non_manifold, &report->defects);
  AddDefect({"turned_triangles", Severity::kWarning, "edges have triangles that face two sides",
             "at vertex", "turn the triangles of one side"},
            turned, &report->defects);
}

std::array<Eigen::Vector3d, 3> CornersOf(const TriangleMesh& mesh, Eigen::Index triangle,
                                         const Eigen::Vector3d& origin) {
  std::array<Eigen::Vector3d, 3> corners;
  for (int k = 0; k < 3; ++k) {
    corners[k] = mesh.positions().row(mesh.triangles()(triangle, k)).transpose() - origin;
  }
  return corners;
}

void MeasureTriangles(const TriangleMesh& mesh, SurfaceReport* report) {
  // From a vertex of the surface: seen from an origin far away the terms of the volume are large
  // and cancel. Of a closed surface the sum is the same from everywhere.
  const Eigen::Vector3d origin = mesh.positions().row(0).transpose();
  double volume = 0;
  for (Eigen::Index f = 0; f < mesh.num_triangles(); ++f) {
    const auto [a, b, c] = CornersOf(mesh, f, origin);
    report->area_mm2 += 0.5 * (b - a).cross(c - a).norm();
    volume += a.dot(b.cross(c)) / 6.0;
  }
  AddDefect({"degenerate_triangles", Severity::kError, "triangles have no area", "triangle",
             "remove or remesh them"},
            DegenerateTriangles(mesh), &report->defects);
  report->enclosed_volume_mm3 = report->is_closed() ? volume : 0;
}

void ReportSplitPolygons(Eigen::Index split_polygons, SurfaceReport* report) {
  if (split_polygons == 0) return;
  MeshDefect defect{"split_polygons", Severity::kWarning, split_polygons, {}, ""};
  defect.explanation =
      absl::StrCat(split_polygons,
                   " faces of the file have more than three corners and were split into "
                   "triangles round their first corner");
  report->defects.push_back(std::move(defect));
}

void FindVertexGroups(const TriangleMesh& mesh, SurfaceReport* report) {
  const ConnectedComponents components =
      FindConnectedComponents(mesh.triangles(), mesh.num_vertices());
  report->num_components = components.count;
  const std::vector<Eigen::Index> unreferenced =
      UnreferencedVertices(components.component_of_vertex);
  report->euler_characteristic = mesh.num_vertices() -
                                 static_cast<Eigen::Index>(unreferenced.size()) -
                                 report->num_edges + mesh.num_triangles();
  AddDefect({"unreferenced_vertices", Severity::kWarning, "vertices belong to no triangle",
             "vertex", "they stay where they are"},
            unreferenced, &report->defects);
  if (components.count < 2) return;
  AddDefect({"several_components", Severity::kWarning, "connected components", "first vertices",
             "each needs a fixed or handle vertex"},
            FirstVertexOfComponents(components.component_of_vertex, components.count),
            &report->defects);
}

void FindDuplicateVertices(const TriangleMesh& mesh, SurfaceReport* report) {
  AddDefect({"duplicate_vertices", Severity::kWarning, "vertices lie exactly on an earlier one",
             "vertex", "the surface is not joined there; merge them unless that is meant"},
            DuplicateVertices(FirstVertexAtSamePlace(mesh.positions())), &report->defects);
}

std::vector<Eigen::Index> NonFiniteVertices(const Positions& positions) {
  std::vector<Eigen::Index> found;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    if (!positions.row(v).allFinite()) found.push_back(v);
  }
  return found;
}

}  // namespace

std::vector<Eigen::Index> DegenerateTriangles(const TriangleMesh& mesh) {
  std::vector<Eigen::Index> degenerate;
  const Eigen::Vector3d origin = mesh.positions().row(0).transpose();
  for (Eigen::Index f = 0; f < mesh.num_triangles(); ++f) {
    const auto [a, b, c] = CornersOf(mesh, f, origin);
    const Eigen::Vector3d p = b - a;
    const Eigen::Vector3d q = c - a;
    const double area = 0.5 * p.cross(q).norm();
    // Against the edge and not in mm^2: a surface in other units has the same defects.
    const double longest = std::max({p.squaredNorm(), q.squaredNorm(), (p - q).squaredNorm()});
    // Also when numbers so large overflow.
    if (!(area > kDegenerateAreaRatio * longest)) degenerate.push_back(f);
  }
  return degenerate;
}

bool SurfaceReport::is_closed() const {
  return Find("open_edges") == nullptr && Find("non_manifold_edges") == nullptr &&
         Find("turned_triangles") == nullptr;
}

SurfaceReport ValidateTriangleMesh(const TriangleMesh& mesh, Eigen::Index split_polygons) {
  SurfaceReport report;
  report.num_vertices = mesh.num_vertices();
  report.num_triangles = mesh.num_triangles();
  ReportSplitPolygons(split_polygons, &report);
  FindBadEdges(mesh.triangles(), &report);
  const std::vector<Eigen::Index> non_finite = NonFiniteVertices(mesh.positions());
  AddDefect({"non_finite_vertices", Severity::kError, "vertices have NaN or infinite coordinates",
             "vertex", "rewrite the file from the program that made it"},
            non_finite, &report.defects);
  if (non_finite.empty()) {
    MeasureTriangles(mesh, &report);
    FindDuplicateVertices(mesh, &report);
  }
  FindVertexGroups(mesh, &report);
  return report;
}

}  // namespace tissueform
