// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Energy of a compressible neo-Hookean body on constant-strain tets, sum over tets of |t| W with
//   W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2,   J = det F,  I1 = |F|^2,
// mu = E / (2 (1 + nu)) and K = E / (3 (1 - 2 nu)): CalculiX's NEO HOOKE with C10 = mu / 2 and
// D1 = 2 / K. Zero at rest and under rigid motions; grows beyond bounds as a tet collapses.
//
// Refers to its arguments. Holds workspaces: one thread at a time. Results do not depend on
// `threads`.
class NeoHookeanEnergy {
 public:
  // REQUIRES: tets of positive volume; `vertex_cells` of these elements; one positive stiffness a
  // tet, in Pa; CheckPoissonRatio is OK.
  NeoHookeanEnergy(const PiecewiseLinearElements& elements, const VertexCells& vertex_cells,
                   const Eigen::VectorXd& stiffness, double poisson_ratio, int threads);

  struct Value {
    double energy_nj = 0;              // nJ = Pa mm^3; infinite when a tet is inverted
    double smallest_volume_ratio = 1;  // the smallest J of the finite ones
    Eigen::Index inverted_tets = 0;    // those with J <= 0, or not finite
  };

  // For `displacements` from rest, #V by 3 in mm. `gradient`, #V by 3, resized, gets the energy's
  // derivatives in Pa mm^2: the forces that hold the body there. It is not written when a tet is
  // inverted.
  Value Evaluate(const Positions& displacements, Positions* gradient);

  // What the energy of so many tets holds.
  static int64_t BytesNeeded(Eigen::Index num_tets);

 private:
  // Energies and volumes of a run of tets; the same blocks sum them up for any number of threads.
  Value EvaluateTets(const Positions& displacements, Eigen::Index begin, Eigen::Index end);
  void GatherLoads(Positions* gradient) const;

  // Constant.
  const PiecewiseLinearElements& elements_;
  const VertexCells& vertex_cells_;
  const Eigen::VectorXd& stiffness_;
  const ElasticModuli unit_;  // of a Young's modulus of one
  const int threads_;

  // Workspaces.
  Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>
      loads_;  // of corners 1 to 3 of each tet
  std::vector<Value> blocks_;
};

}  // namespace tissueform
