// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/mesh/generation/surfaces.h"

#include <Eigen/Geometry>

#include "core/mesh/bar_mesh.h"
#include "core/mesh/tet_topology.h"

namespace tissueform::testing {
namespace {

// The boundary of a mesh of tets as a mesh of its own.
TriangleMesh Boundary(const TetMesh& mesh) {
  const std::vector<int32_t> vertices = BoundaryVertices(mesh);
  std::vector<int32_t> number(static_cast<size_t>(mesh.num_vertices()), -1);
  Positions positions(static_cast<Eigen::Index>(vertices.size()), 3);
  for (size_t k = 0; k < vertices.size(); ++k) {
    number[vertices[k]] = static_cast<int32_t>(k);
    positions.row(static_cast<Eigen::Index>(k)) = mesh.positions().row(vertices[k]);
  }
  TriangleIndices triangles = BoundaryFacets(mesh);
  for (int32_t& v : triangles.reshaped<Eigen::RowMajor>()) v = number[v];
  return *TriangleMesh::Create(positions, triangles);
}

}  // namespace

TriangleMesh BoxSurface(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int cells) {
  return Boundary(*BarMesh({.x = EvenPlanes(low.x(), high.x(), cells),
                            .y = EvenPlanes(low.y(), high.y(), cells),
                            .z = EvenPlanes(low.z(), high.z(), cells)}));
}

TriangleMesh SphereSurface(const Eigen::Vector3d& centre, double radius_mm, int cells) {
  const Eigen::Vector3d ones = Eigen::Vector3d::Ones();
  const TriangleMesh box = BoxSurface(-ones, ones, cells);
  Positions positions = box.positions();
  for (auto p : positions.rowwise()) p = radius_mm * p.normalized() + centre.transpose();
  return *TriangleMesh::Create(positions, box.triangles());
}

TriangleMesh Together(const TriangleMesh& a, const TriangleMesh& b) {
  Positions positions(a.num_vertices() + b.num_vertices(), 3);
  positions << a.positions(), b.positions();
  TriangleIndices triangles(a.num_triangles() + b.num_triangles(), 3);
  triangles << a.triangles(), b.triangles();
  triangles.bottomRows(b.num_triangles()).array() += static_cast<int32_t>(a.num_vertices());
  return *TriangleMesh::Create(positions, triangles);
}

TriangleMesh InsideOut(const TriangleMesh& surface) {
  TriangleIndices triangles = surface.triangles();
  triangles.col(0).swap(triangles.col(1));
  return *TriangleMesh::Create(surface.positions(), triangles);
}

TriangleMesh WithHole(const TriangleMesh& surface) {
  return *TriangleMesh::Create(surface.positions(),
                               surface.triangles().topRows(surface.num_triangles() - 1));
}

double VolumeInside(const TriangleMesh& surface) {
  double volume = 0;
  for (const auto& t : surface.triangles().rowwise()) {
    const Eigen::Vector3d a = surface.positions().row(t[0]);
    const Eigen::Vector3d b = surface.positions().row(t[1]);
    const Eigen::Vector3d c = surface.positions().row(t[2]);
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

}  // namespace tissueform::testing
