// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/surface_decimation.h"

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

namespace tissueform {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
namespace sms = CGAL::Surface_mesh_simplification;

using DecimationKernel = CGAL::Simple_cartesian<double>;
using Halfedges = CGAL::Surface_mesh<DecimationKernel::Point_3>;

absl::StatusOr<Halfedges> ToHalfedges(const TriangleMesh& surface) {
  std::vector<DecimationKernel::Point_3> points;
  for (const auto& p : surface.positions().rowwise()) points.emplace_back(p[0], p[1], p[2]);
  std::vector<std::array<std::size_t, 3>> triangles;
  triangles.reserve(static_cast<std::size_t>(surface.num_triangles()));
  for (const auto& t : surface.triangles().rowwise()) {
    triangles.push_back({static_cast<std::size_t>(t[0]), static_cast<std::size_t>(t[1]),
                         static_cast<std::size_t>(t[2])});
  }
  // Where walls touch, in an edge or a vertex, they are taken apart.
  if (!pmp::is_polygon_soup_a_polygon_mesh(triangles)) pmp::orient_polygon_soup(points, triangles);
  if (!pmp::is_polygon_soup_a_polygon_mesh(triangles)) {
    return absl::InvalidArgumentError(
        "the triangles are not an orientable surface; it cannot be decimated");
  }
  Halfedges mesh;
  pmp::polygon_soup_to_polygon_mesh(points, triangles, mesh);
  pmp::remove_isolated_vertices(mesh);
  return mesh;
}

TriangleMesh ToTriangles(const Halfedges& mesh) {
  Positions positions(static_cast<Eigen::Index>(mesh.number_of_vertices()), 3);
  std::vector<int32_t> row(mesh.num_vertices(), -1);  // removed ones count as well
  int32_t next = 0;
  for (const auto v : mesh.vertices()) {
    const auto& p = mesh.point(v);
    positions.row(next) << p.x(), p.y(), p.z();
    row[v.idx()] = next++;
  }
  TriangleIndices triangles(static_cast<Eigen::Index>(mesh.number_of_faces()), 3);
  Eigen::Index f = 0;
  for (const auto face : mesh.faces()) {
    int k = 0;
    for (const auto v : CGAL::vertices_around_face(mesh.halfedge(face), mesh)) {
      triangles(f, k++) = row[v.idx()];
    }
    ++f;
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

}  // namespace

absl::StatusOr<TriangleMesh> DecimateSurface(const TriangleMesh& surface, int64_t triangles) {
  if (surface.num_triangles() <= triangles) return surface;
  absl::StatusOr<Halfedges> mesh = ToHalfedges(surface);
  if (!mesh.ok()) return mesh.status();
  // A closed surface has three edges for two triangles.
  const sms::Count_stop_predicate<Halfedges> stop(static_cast<std::size_t>(triangles) * 3 / 2);
  sms::edge_collapse(*mesh, stop,
                     CGAL::parameters::get_cost(sms::LindstromTurk_cost<Halfedges>())
                         .get_placement(sms::LindstromTurk_placement<Halfedges>())
                         .filter(sms::Bounded_normal_change_filter<>()));
  return ToTriangles(*mesh);
}

}  // namespace tissueform
