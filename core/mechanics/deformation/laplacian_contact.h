// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/base/cancellation.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// The contact rows of a constraint set, condensed to the rows themselves, for models whose three
// coordinates are each solved for with one Laplacian L. With N the directions of the rows,
//
//   d = L^-1 (b + N^T l),   g = q + C l,   C_ij = (n_i . n_j) (L^-1)_(v_i v_j),
//
// d being displacements, g the gaps of contact, q those that b alone gives, and of a row between
// two vertices the difference of both in place of a vertex. Rows couple the coordinates. So that
// one LCP remains, of the rows that may lift off, bilateral rows are eliminated by a dense factor:
//
//   C' = C_uu - C_ue C_ee^-1 C_eu,   q' = q_u - C_ue C_ee^-1 q_e.
//
// d then minimises tr(d^T L d) / 2 - tr(b^T d) among all displacements that meet the rows and have
// the same prescribed values. Vectors of all rows are in the order of the constraint set.
// Immutable.
class LaplacianContact {
 public:
  // Costs one back-substitution of a single right-hand side a vertex with rows.
  //
  // Errors: InvalidArgument (a row that cannot move: its vertices slide along that normal), those
  // of DirichletSystem::Solve, Cancelled, or what `admission`, which may be empty, says of the
  // bytes.
  static absl::StatusOr<std::unique_ptr<LaplacianContact>> Create(
      const ConstraintSet& constraints, const DirichletSystem& laplacian,
      const FactorAdmission& admission, const Cancellation& cancellation = {});

  bool empty() const { return rows_.empty(); }
  size_t num_unilateral() const { return unilateral_.size(); }
  // C', mm per Pa mm^2: symmetric to the bit, positive semi-definite.
  const Eigen::MatrixXd& compliance() const { return compliance_; }

  // g of displacements (#V by 3); see HandleTargets::resting_gaps.
  Eigen::VectorXd Gaps(const Eigen::MatrixXd& displacements,
                       const Eigen::VectorXd& resting_gaps) const;
  // Of the unilateral rows alone.
  Eigen::VectorXd OfUnilateral(const Eigen::VectorXd& of_rows) const {
    return of_rows(unilateral_);
  }
  // q' of q.
  Eigen::VectorXd Condense(const Eigen::VectorXd& gaps) const;
  // l of q and of the part of l that belongs to unilateral rows.
  Eigen::VectorXd Multipliers(const Eigen::VectorXd& gaps,
                              const Eigen::VectorXd& of_unilateral) const;
  // Adds N^T l to `loads`, #V by 3.
  void AddLoads(const Eigen::VectorXd& multipliers, Eigen::MatrixXd* loads) const;

  int64_t bytes_held() const;

 private:
  explicit LaplacianContact(const ConstraintSet& constraints);

  // L^-1 between the vertices with rows.
  absl::StatusOr<Eigen::MatrixXd> VertexCompliance(const DirichletSystem& laplacian,
                                                   const Cancellation& cancellation) const;
  Eigen::MatrixXd RowCompliance(const Eigen::MatrixXd& of_vertices) const;
  absl::Status Eliminate(const Eigen::MatrixXd& of_rows);

  const std::vector<ContactRow> rows_;
  std::vector<int32_t> vertices_;            // with rows, rising
  std::vector<int32_t> bilateral_;           // rows, rising
  std::vector<int32_t> unilateral_;          // rows, rising
  Eigen::LLT<Eigen::MatrixXd> held_factor_;  // of C_ee
  Eigen::MatrixXd held_to_free_;             // C_ee^-1 C_eu
  Eigen::MatrixXd compliance_;
};

}  // namespace tissueform
