// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/mechanics/contact/lcp_solver.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// Solves with a prepared Laplacian under its contact rows: one back-substitution without rows, the
// same answer to the bit as the system's own; two with rows. The LCP starts from the rows that were
// active last, and its answer does not depend on that. One thread at a time.
class ContactReconstruction {
 public:
  struct Answer {
    Eigen::MatrixXd displacements;  // #V by 3
    Eigen::VectorXd forces;         // of the unilateral rows
    bool converged = true;          // the LCP
  };

  // `laplacian` must outlive it.
  explicit ContactReconstruction(const PreparedLaplacian& laplacian);

  // `rhs` (#V by 3, or no rows: zero) becomes the right-hand side with the forces of contact.
  absl::StatusOr<Answer> Solve(const HandleTargets& targets, Eigen::MatrixXd* rhs);

  // The contact of displacements under forces, which need not be of one answer: the residual shows
  // how well they belong together.
  ContactAnswer Describe(const Eigen::MatrixXd& displacements, const Eigen::VectorXd& forces,
                         const HandleTargets& targets) const;

  // The smallest gap of a unilateral row; infinite without any.
  double SmallestGap(const Eigen::MatrixXd& displacements, const HandleTargets& targets) const;

 private:
  const DirichletSystem& system_;
  const LaplacianContact& contact_;
  LcpSolver solver_;
};

}  // namespace tissueform
