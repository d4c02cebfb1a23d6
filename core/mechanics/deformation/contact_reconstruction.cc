// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/contact_reconstruction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

std::span<const double> NumbersOf(const Eigen::MatrixXd& matrix) {
  return {matrix.data(), static_cast<size_t>(matrix.size())};
}

}  // namespace

ContactReconstruction::ContactReconstruction(const PreparedLaplacian& laplacian)
    : system_(*laplacian.system),
      contact_(*laplacian.contact),
      solver_(NumbersOf(contact_.compliance()), contact_.num_unilateral()) {}

absl::StatusOr<ContactReconstruction::Answer> ContactReconstruction::Solve(
    const HandleTargets& targets, Eigen::MatrixXd* rhs) {
  Answer answer;
  TF_ASSIGN_OR_RETURN(answer.displacements, system_.Solve(*rhs, targets.displacements));
  if (contact_.empty()) return answer;
  const Eigen::VectorXd gaps = contact_.Gaps(answer.displacements, targets.resting_gaps);
  const Eigen::VectorXd condensed = contact_.Condense(gaps);
  const LcpSolution& solution =
      solver_.Solve({condensed.data(), static_cast<size_t>(condensed.size())});
  answer.converged = solution.converged;
  answer.forces = Eigen::Map<const Eigen::VectorXd>(solution.multipliers.data(), condensed.size());
  const Eigen::VectorXd multipliers = contact_.Multipliers(gaps, answer.forces);
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(answer.displacements.rows(), 3);
  contact_.AddLoads(multipliers, &loads);
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd pushed,
                      system_.Solve(loads, Eigen::MatrixXd::Zero(targets.displacements.rows(), 3)));
  answer.displacements += pushed;
  if (rhs->rows() == 0) {
    *rhs = std::move(loads);
  } else {
    *rhs += loads;
  }
  return answer;
}

ContactAnswer ContactReconstruction::Describe(const Eigen::MatrixXd& displacements,
                                              const Eigen::VectorXd& forces,
                                              const HandleTargets& targets) const {
  ContactAnswer answer;
  if (contact_.num_unilateral() == 0) return answer;
  const Eigen::VectorXd gaps =
      contact_.OfUnilateral(contact_.Gaps(displacements, targets.resting_gaps));
  answer.forces.assign(forces.begin(), forces.end());
  answer.gaps_mm.assign(gaps.begin(), gaps.end());
  answer.residual_mm = gaps.cwiseMin(contact_.compliance().diagonal().cwiseProduct(forces))
                           .lpNorm<Eigen::Infinity>();
  return answer;
}

double ContactReconstruction::SmallestGap(const Eigen::MatrixXd& displacements,
                                          const HandleTargets& targets) const {
  if (contact_.num_unilateral() == 0) return std::numeric_limits<double>::infinity();
  return contact_.OfUnilateral(contact_.Gaps(displacements, targets.resting_gaps)).minCoeff();
}

}  // namespace tissueform
