// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/operators/piecewise_linear_elements.h"

#include "core/base/parallel_for.h"
#include "core/mesh/tet_quality.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kCellGrain = 4096;

template <typename Mesh, typename Cells>
PiecewiseLinearElements View(const Mesh& mesh, const Cells& cells) {
  return {{mesh.positions().data(), mesh.num_vertices(), 3},
          {cells.data(), cells.rows(), cells.cols()},
          mesh.storage(),
          {},
          {}};
}

}  // namespace

PiecewiseLinearElements ElementsOf(const TetMesh& mesh) {
  PiecewiseLinearElements elements = View(mesh, mesh.tets());
  elements.measures = TetVolumes(mesh.positions(), mesh.tets());
  return elements;
}

PiecewiseLinearElements ElementsOf(const TriangleMesh& mesh, int threads) {
  const Positions& v = mesh.positions();
  PiecewiseLinearElements elements = View(mesh, mesh.triangles());
  elements.measures.resize(mesh.num_triangles());
  elements.normals.resize(mesh.num_triangles(), 3);
  ParallelFor(threads, mesh.num_triangles(), kCellGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index f = begin; f < end; ++f) {
      const auto triangle = mesh.triangles().row(f);
      const Eigen::Vector3d origin = v.row(triangle[0]);
      const Eigen::Vector3d area_vector =
          0.5 *
          (v.row(triangle[1]).transpose() - origin).cross(v.row(triangle[2]).transpose() - origin);
      const double area = area_vector.norm();
      elements.measures[f] = area;
      elements.normals.row(f) = area_vector / area;
    }
  });
  return elements;
}

}  // namespace tissueform
