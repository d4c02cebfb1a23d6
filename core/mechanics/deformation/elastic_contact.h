// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/base/cancellation.h"
#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/deformation/elastic_system.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The unilateral contact rows of a constraint set, condensed to the rows themselves. With N the
// directions of the rows (#rows by 3 #V), R the elastic response columns and a the coefficients of
// the poses, the displacements and the gaps of contact are
//
//   u = R a + K^-1 N^T l,   g = q + C l,   q = Q a + g0,   C = N K^-1 N^T,
//
// g0 being the gaps at rest and l >= 0 the contact forces, which LcpSolver finds. Rows are those of
// the constraint set that are not bilateral, in its order. Immutable.
class ElasticContact {
 public:
  // `elastic` and its constraint set must outlive it. Costs one back-substitution a row.
  //
  // Errors: InvalidArgument (a row that cannot move: its vertices slide along that normal), those
  // of ElasticSystem::Solve, Cancelled, or what `admission`, which may be empty, says of the bytes.
  static absl::StatusOr<std::unique_ptr<ElasticContact>> Create(
      const TetMesh& mesh, const ConstraintSet& constraints, const ElasticSystem& elastic,
      const FactorAdmission& admission, const Cancellation& cancellation = {});

  const std::vector<int32_t>& rows() const { return rows_; }      // indices in the constraint set
  const SparseMatrix& directions() const { return directions_; }  // N^T, 3 #V by #rows
  // mm per Pa mm^2; #rows by #rows, symmetric to the bit, positive semi-definite.
  const Eigen::MatrixXd& compliance() const { return compliance_; }
  const Eigen::MatrixXd& gap_columns() const { return gap_columns_; }    // Q, #rows by 12 #handles
  const Eigen::VectorXd& gaps_at_rest() const { return gaps_at_rest_; }  // g0, mm

  // q in mm, without contact.
  Eigen::VectorXd Gaps(const Eigen::VectorXd& coefficients) const {
    return gap_columns_ * coefficients + gaps_at_rest_;
  }
  // K^-1 f, 3 #V by k in mm, of forces on vertices (3 #V by k, Pa mm^2) while all bone rests.
  // Errors: those of ElasticSystem::Solve.
  absl::StatusOr<Eigen::MatrixXd> Respond(const Eigen::MatrixXd& forces) const;
  // K^-1 N^T l, 3 #V in mm, of contact forces in Pa mm^2. Errors: those of ElasticSystem::Solve.
  absl::StatusOr<Eigen::VectorXd> Displacements(std::span<const double> forces) const;

  // Displacements of the vertices by a unit force in every row, K^-1 N^T: 3 #vertices by #rows, a
  // vertex' coordinates in turn. Those of the mesh's boundary are kept; others cost one
  // back-substitution a row. Errors: those of ElasticSystem::Solve, Cancelled.
  absl::StatusOr<Eigen::MatrixXd> ForceColumns(const std::vector<int32_t>& vertices,
                                               const Cancellation& cancellation = {}) const;

  int64_t bytes_held() const;

 private:
  explicit ElasticContact(const ElasticSystem& elastic) : elastic_(elastic) {}

  void TakeRows(const TetMesh& mesh, const ConstraintSet& constraints);
  // With boundary_columns_.
  absl::Status MakeCompliance(const Cancellation& cancellation);
  // Calls take(first row, K^-1 N^T of some rows, 3 #V by their number) until all rows were taken.
  absl::Status SolveForRows(
      const std::function<void(Eigen::Index first, const Eigen::MatrixXd& responses)>& take,
      const Cancellation& cancellation) const;

  const ElasticSystem& elastic_;
  std::vector<int32_t> rows_;
  SparseMatrix directions_;
  Eigen::MatrixXd compliance_;
  Eigen::MatrixXd gap_columns_;
  std::vector<int32_t> boundary_;     // vertices, rising
  Eigen::MatrixXd boundary_columns_;  // 3 #boundary by #rows
  Eigen::VectorXd gaps_at_rest_;
  Eigen::Index num_constrained_ = 0;
};

}  // namespace tissueform
