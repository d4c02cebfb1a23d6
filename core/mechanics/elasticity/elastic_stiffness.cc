// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/elastic_stiffness.h"

#include "core/mechanics/elasticity/material.h"
#include "core/mechanics/elasticity/vertex_blocks.h"

namespace tissueform {

SparseMatrix ElasticStiffness(const PiecewiseLinearElements& elements,
                              const VertexCells& vertex_cells, const Eigen::VectorXd& stiffness,
                              double poisson_ratio, int threads) {
  const ElasticModuli unit = ModuliOf(1.0, poisson_ratio);  // of a Young's modulus of one
  const auto blocks_of_tet = [&](int32_t tet, int own, TetBlocks* blocks) {
    Eigen::Matrix<double, 3, 4> g;
    g.rightCols<3>() = HatGradients<4>(elements, tet);
    g.col(0) = -g.rightCols<3>().rowwise().sum();
    const double weight = elements.measures[tet] * stiffness[tet];
    for (int corner = 0; corner < 4; ++corner) {
      // Evaluated ahead of the factors, so that swapping the vertices transposes to the bit.
      const Eigen::Matrix3d outer = g.col(own) * g.col(corner).transpose();
      Eigen::Matrix3d block = unit.first_lame * outer.transpose() + unit.shear * outer;
      block.diagonal().array() += unit.shear * outer.trace();
      (*blocks)[static_cast<size_t>(corner)] = weight * block;
    }
  };
  return AssembleVertexBlocks(elements, vertex_cells, blocks_of_tet, threads);
}

}  // namespace tissueform
