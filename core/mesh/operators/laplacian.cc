// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/operators/laplacian.h"

#include <cmath>

#include <Eigen/Geometry>

#include "core/base/parallel_for.h"
#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kCellGrain = 4096;

// cot of the dihedral angle at the edge from p to q between the facets that end in r and in s,
// times the length of the edge. With a = (q-p) x (r-p) and b = (q-p) x (s-p): |q-p| cot = |q-p| (a
// . b) / |a x b|, and |a x b| = |q-p| * 6 |volume|.
double LengthTimesCotangent(const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                            const Eigen::Vector3d& r, const Eigen::Vector3d& s) {
  const Eigen::Vector3d edge = q - p;
  const Eigen::Vector3d normal_r = edge.cross(r - p);
  const Eigen::Vector3d normal_s = edge.cross(s - p);
  const double six_volumes = std::abs(normal_r.dot(s - p));
  return normal_r.dot(normal_s) / six_volumes;
}

}  // namespace

TetCotangentWeights CotangentWeights(const TetMesh& mesh, int threads) {
  TetCotangentWeights weights(mesh.num_tets(), 6);
  const Positions& v = mesh.positions();
  ParallelFor(threads, mesh.num_tets(), kCellGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index t = begin; t < end; ++t) {
      const auto tet = mesh.tets().row(t);
      for (int e = 0; e < 6; ++e) {
        const auto [r, s] = kTetEdges[e];
        const auto [p, q] = kTetEdges[5 - e];
        weights(t, e) =
            LengthTimesCotangent(v.row(tet[p]), v.row(tet[q]), v.row(tet[r]), v.row(tet[s])) / 6.0;
      }
    }
  });
  return weights;
}

TriangleCotangentWeights CotangentWeights(const TriangleMesh& mesh, int threads) {
  TriangleCotangentWeights weights(mesh.num_triangles(), 3);
  const Positions& v = mesh.positions();
  ParallelFor(threads, mesh.num_triangles(), kCellGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index f = begin; f < end; ++f) {
      const auto triangle = mesh.triangles().row(f);
      for (int k = 0; k < 3; ++k) {
        const Eigen::RowVector3d corner = v.row(triangle[k]);
        const Eigen::RowVector3d a = v.row(triangle[(k + 1) % 3]) - corner;
        const Eigen::RowVector3d b = v.row(triangle[(k + 2) % 3]) - corner;
        weights(f, k) = 0.5 * a.dot(b) / a.cross(b).norm();
      }
    }
  });
  return weights;
}

SparseMatrix CotangentLaplacian(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                                int threads) {
  TetCotangentWeights weights = CotangentWeights(mesh, threads);
  weights.array().colwise() *= stiffness.array();
  return AssembleEdgeLaplacian(mesh.tets(), mesh.num_vertices(), weights, threads);
}

SparseMatrix CotangentLaplacian(const TriangleMesh& mesh, const Eigen::VectorXd& stiffness,
                                int threads) {
  TriangleCotangentWeights weights = CotangentWeights(mesh, threads);
  weights.array().colwise() *= stiffness.array();
  return AssembleEdgeLaplacian(mesh.triangles(), mesh.num_vertices(), weights, threads);
}

}  // namespace tissueform
