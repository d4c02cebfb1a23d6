// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {

// The laws of the elastic models.
enum class ElasticLaw {
  kLinear,      // sigma = lambda tr(e) I + 2 mu e with the small strain e, on the rest shape
  kNeoHookean,  // that of NeoHookeanEnergy: sigma = mu J^(-5/3) dev(F F^T) + K (J - 1) I
};

// What a body bears in a state of deformation, computed by any model.
struct ElasticState {
  // Cauchy's stress sigma as sqrt(3/2) |dev sigma|, #T, Pa. (The linear model has one stress; a
  // large rotation shows in it.)
  Eigen::VectorXd von_mises_pa;
  Eigen::VectorXd energy_density_pa;  // #T, J/m^3 = Pa, of the rest volume
  double strain_energy_mj = 0;        // of all tets; mJ = N mm, a million of the models' nJ
  // The forces from outside that hold every vertex where it is, #V by 3, N: what a handle or what
  // is fixed does to the tissue (the tissue does the opposite to it). At a free vertex in
  // equilibrium they vanish; what is there is what the search has left. Their sum vanishes, and so
  // does that of their moments.
  Positions forces_n;
  // Where they act, #V by 3, mm: on the rest shape by the linear law, whose equilibrium is written
  // there, on the deformed shape by the other.
  Positions points_mm;
};

// For `positions` of the vertices, #V by 3 in mm. The neo-Hookean law has no stress for a tet that
// is flat or inverted: what that tet has a part in is NaN.
//
// REQUIRES: tets of positive volume; one positive stiffness a tet, in Pa; CheckPoissonRatio is OK.
ElasticState MeasureElasticState(ElasticLaw law, const PiecewiseLinearElements& elements,
                                 const Positions& positions, const Eigen::VectorXd& stiffness,
                                 double poisson_ratio);

// What the forces on some vertices come to.
struct Resultant {
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero();
  // Sum of (point - about_mm) x force. About another point q it is the moment here plus
  // (about_mm - q) x force_n.
  Eigen::Vector3d moment_n_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d about_mm = Eigen::Vector3d::Zero();  // the mean of the vertices' points
};

// Zero for no vertices.
Resultant ResultantOf(const ElasticState& state, const std::vector<int32_t>& vertices);

}  // namespace tissueform
