// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/boundary_surface.h"

#include <utility>

#include "core/mesh/tet_topology.h"

namespace tissueform {

BoundarySurface BoundaryOf(const TetMesh& mesh) {
  TriangleIndices triangles = BoundaryFacets(mesh);
  std::vector<int32_t> vertices = BoundaryVertices(mesh);
  std::vector<int32_t> number(static_cast<size_t>(mesh.num_vertices()), -1);
  for (size_t v = 0; v < vertices.size(); ++v) {
    number[static_cast<size_t>(vertices[v])] = static_cast<int32_t>(v);
  }
  for (int32_t& corner : triangles.reshaped()) corner = number[static_cast<size_t>(corner)];
  // A boundary is never empty and its indices are in range.
  TriangleMesh surface =
      TriangleMesh::Create(mesh.positions()(vertices, Eigen::all), std::move(triangles)).value();
  return {std::move(surface), std::move(vertices)};
}

std::vector<int32_t> VerticesWhere(const Positions& positions,
                                   const std::function<bool(const Eigen::Vector3d&)>& inside) {
  std::vector<int32_t> selected;
  for (int32_t v = 0; v < positions.rows(); ++v) {
    if (inside(positions.row(v).transpose())) selected.push_back(v);
  }
  return selected;
}

absl::StatusOr<ConstraintSet> ConstrainEnds(const Positions& positions) {
  const double low = positions.col(2).minCoeff();
  const double high = positions.col(2).maxCoeff();
  return ConstraintSet::Create(
      positions.rows(),
      VerticesWhere(positions, [=](const Eigen::Vector3d& v) { return v.z() == low; }),
      {{"end", VerticesWhere(positions, [=](const Eigen::Vector3d& v) { return v.z() == high; })}});
}

}  // namespace tissueform
