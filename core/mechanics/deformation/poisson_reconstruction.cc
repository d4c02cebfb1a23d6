// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/poisson_reconstruction.h"

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

// What one thread takes at a time: some tenths of a millisecond, long beside handing it out and
// short beside the whole.
constexpr Eigen::Index kCellGrain = 4096;
constexpr Eigen::Index kVertexGrain = 1024;

template <int kCorners>
void ConvertCells(const PiecewiseLinearElements& elements, const Eigen::VectorXd& stiffness,
                  int threads, CellTransforms* transforms) {
  ParallelFor(threads, transforms->rows(), kCellGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index c = begin; c < end; ++c) {
      double* row = transforms->row(c).data();
      Eigen::Matrix3d turn = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(row);
      // P - I instead of P: the right-hand side is then that of the displacements, and identity
      // poses give rest to the bit. In place: transforms are the largest array of an answer, and
      // their nine numbers are read before the loads take their room.
      turn.diagonal().array() -= 1.0;
      Eigen::Map<Eigen::Matrix3d> loads(row);
      loads.setZero();
      loads.leftCols<kCorners - 1>().noalias() =
          stiffness[c] * turn * HatGradientIntegrals<kCorners>(elements, c);
    }
  });
}

}  // namespace

void TransformsToCornerLoads(const PiecewiseLinearElements& elements,
                             const Eigen::VectorXd& stiffness, int threads,
                             CellTransforms* transforms) {
  if (elements.corners() == 4) {
    ConvertCells<4>(elements, stiffness, threads, transforms);
  } else {
    ConvertCells<3>(elements, stiffness, threads, transforms);
  }
}

Eigen::MatrixXd GatherCornerLoads(const VertexCells& vertex_cells, Eigen::Index num_vertices,
                                  const CornerLoads& loads, int threads) {
  if (loads.rows() == 0) {
    return {};
  }
  Eigen::MatrixXd rhs(num_vertices, 3);
  ParallelFor(threads, num_vertices, kVertexGrain, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index v = begin; v < end; ++v) {
      // Gathered by vertex and not scattered by cell: no two threads write to one place, and the
      // order of the sum does not depend on how many there are.
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (Eigen::Index k = vertex_cells.begin(v); k < vertex_cells.end(v); ++k) {
        const Eigen::Map<const Eigen::Matrix3d> of_cell(loads.row(vertex_cells.cell(k)).data());
        const int corner = vertex_cells.corner(k);
        if (corner == 0) {
          sum -= of_cell.rowwise().sum();
        } else {
          sum += of_cell.col(corner - 1);
        }
      }
      rhs.row(v) = sum;
    }
  });
  return rhs;
}

}  // namespace tissueform
