// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-wrap: wraps surfaces with CGAL for another program of ours.

#include <array>
#include <utility>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

#include "core/mesh/generation/wrap_call.h"

namespace tissueform {
namespace {

using Point = CGAL::Exact_predicates_inexact_constructions_kernel::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;

std::vector<Point> PointsOf(const TriangleMesh& surface) {
  std::vector<Point> points;
  points.reserve(static_cast<size_t>(surface.num_vertices()));
  for (const auto& p : surface.positions().rowwise()) points.emplace_back(p[0], p[1], p[2]);
  return points;
}

std::vector<std::array<size_t, 3>> FacesOf(const TriangleMesh& surface) {
  std::vector<std::array<size_t, 3>> faces;
  faces.reserve(static_cast<size_t>(surface.num_triangles()));
  for (const auto& t : surface.triangles().rowwise()) {
    faces.push_back(
        {static_cast<size_t>(t[0]), static_cast<size_t>(t[1]), static_cast<size_t>(t[2])});
  }
  return faces;
}

absl::StatusOr<TriangleMesh> ToTriangleMesh(Mesh mesh) {
  mesh.collect_garbage();
  Positions positions(static_cast<Eigen::Index>(mesh.number_of_vertices()), 3);
  TriangleIndices triangles(static_cast<Eigen::Index>(mesh.number_of_faces()), 3);
  for (const auto v : mesh.vertices()) {
    const Point& p = mesh.point(v);
    positions.row(static_cast<Eigen::Index>(v.idx())) << p.x(), p.y(), p.z();
  }
  for (const auto f : mesh.faces()) {
    Eigen::Index corner = 0;
    for (const auto v : CGAL::vertices_around_face(mesh.halfedge(f), mesh)) {
      triangles(static_cast<Eigen::Index>(f.idx()), corner++) = static_cast<int32_t>(v.idx());
    }
  }
  return TriangleMesh::Create(std::move(positions), std::move(triangles));
}

absl::StatusOr<TriangleMesh> RunAlphaWrap(const TriangleMesh& surface, double alpha_mm,
                                          double offset_mm) {
  Mesh mesh;
  CGAL::alpha_wrap_3(PointsOf(surface), FacesOf(surface), alpha_mm, offset_mm, mesh);
  return ToTriangleMesh(std::move(mesh));
}

}  // namespace
}  // namespace tissueform

int main() { return tissueform::RunWrapProgram(tissueform::RunAlphaWrap); }
