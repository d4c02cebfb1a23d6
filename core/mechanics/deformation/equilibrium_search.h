// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/deformation/lbfgs_history.h"
#include "core/mechanics/deformation/turning_contact.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// Walks towards the minimum of a neo-Hookean energy over the free vertices, the constrained ones
// staying where the start has them, by L-BFGS with the factorised linear stiffness as first inverse
// Hessian (Liu, Bouaziz, Kavan 2017). Every state has all tets positive, and the energy does not
// rise. With contact it keeps to displacements that leave the gaps of the bilateral and closed rows
// as the start has them. One thread at a time.
class EquilibriumSearch {
 public:
  // Refers to energy and system. `system` is the linear stiffness with unknowns 3 v + axis, three
  // for every free vertex; `rounded` stands in for its factor, or is null. `force_unit` is the
  // size, in Pa mm^2, of the forces below which rounding is all that is left; see residual().
  // `contact`, which may be null, has the local unknowns of `system`; after it has changed, Start
  // is to be called.
  EquilibriumSearch(NeoHookeanEnergy* energy, const DirichletSystem* system,
                    const SinglePrecisionSolver* rounded, const TurningContact* contact,
                    double force_unit, int history);

  // Goes on from these displacements (#V by 3, mm), forgetting the steps so far. False, and nothing
  // is changed, when they invert a tet.
  bool Start(Positions displacements);

  // Forgets the steps so far and takes `system`, of the same free unknowns, in place of the linear
  // stiffness as first inverse Hessian; null: the linear stiffness again. With the tangent at this
  // state the next step is Newton's. `system` must live until another call.
  void PreconditionBy(const DirichletSystem* system);

  // One step: one back-substitution, and an evaluation of the energy for every length that is
  // tried. Returns the largest change of a vertex in mm; 0 when no length lowers the energy: the
  // end of what the arithmetic can do.
  //
  // Errors: those of the linear solver.
  absl::StatusOr<double> Step();

  // Of the last step, as a part of the whole one; 0 before the first.
  double step_length() const { return step_length_; }
  // The norm of the forces on the free vertices, which vanish in equilibrium, over that of the
  // forces that the constrained vertices, and rows of contact, bear plus force_unit.
  double residual() const { return residual_; }
  const Positions& displacements() const { return displacements_; }
  const NeoHookeanEnergy::Value& value() const { return value_; }
  // Of the unilateral rows of contact, in Pa mm^2. REQUIRES: contact.
  Eigen::VectorXd ContactForces() const { return contact_->Forces(LocalGradient()); }
  // What a search holds at most.
  static int64_t BytesNeeded(Eigen::Index num_vertices, int history);

 private:
  // A point on the line of a step.
  struct Trial {
    Positions displacements;
    Positions gradient;
    NeoHookeanEnergy::Value value;
  };

  void Accept(Trial* trial);
  // Sets trial_ to the accepted point and returns the length, or 0.
  double SearchLine(const Eigen::VectorXd& direction, double slope);
  Eigen::VectorXd FreePart(const Positions& field) const;
  // All unknowns of the free ones, the others zero.
  Eigen::VectorXd WithOthers(const Eigen::VectorXd& free) const;
  // Free local unknowns along x, y and z. REQUIRES: contact, as the next one.
  Eigen::VectorXd FreeAlongAxes(const Eigen::VectorXd& local) const;
  Eigen::VectorXd LocalGradient() const;
  absl::StatusOr<Eigen::VectorXd> Solve(const Eigen::VectorXd& rhs);
  absl::StatusOr<Eigen::VectorXd> Precondition(const Eigen::VectorXd& rhs);

  NeoHookeanEnergy& energy_;
  const DirichletSystem& system_;
  const SinglePrecisionSolver* const rounded_;  // may be null
  const TurningContact* const contact_;         // may be null
  const double force_unit_;

  // The state.
  Positions displacements_;
  Positions gradient_;
  NeoHookeanEnergy::Value value_;
  Eigen::VectorXd free_gradient_;
  double residual_ = 0;
  double step_length_ = 0;
  LbfgsHistory history_;
  const DirichletSystem* tangent_ = nullptr;  // in place of the linear stiffness, or null

  // Workspaces.
  Trial trial_;
  Eigen::MatrixXd rhs_;
  Eigen::MatrixXd solution_;
  Eigen::VectorXf rounded_rhs_;
  Eigen::VectorXf rounded_solution_;
};

}  // namespace tissueform
