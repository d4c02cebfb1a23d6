// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/base/cancellation.h"
#include "core/base/types.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/elastic_contact.h"

namespace tissueform {

// Contact of lips whose lower edge is held at given heights, condensed to the rows of contact. With
// S the direction `up` at the vertices of the lower edge, s the forces there and h the heights,
//
//   u = R a + K^-1 (N^T l + S s),   S^T u = h,
//
// the rest as in ElasticContact. With Css = S^T K^-1 S, Cus = N K^-1 S and the raise
// r = h - S^T R a the forces are s = Css^-1 (r - Cus^T l), and what remains for LcpSolver is
//
//   g = (q + Cus Css^-1 r) + (C - Cus Css^-1 Cus^T) l.
//
// No force acts on the upper edge but that of contact. Immutable.
class LipSeal {
 public:
  // `contact` must outlive it. Costs one back-substitution a pair. REQUIRES: the edge has passed
  // CheckLipEdge with the rows of `contact`.
  //
  // Errors: InvalidArgument (a lower vertex slides on bone along `up`, or a row of contact cannot
  // move once the lips are sealed), those of ElasticContact::Respond, Cancelled.
  static absl::StatusOr<std::unique_ptr<LipSeal>> Create(const LipEdge& edge,
                                                         const ElasticContact& contact,
                                                         const Cancellation& cancellation = {});

  int64_t num_pairs() const { return static_cast<int64_t>(edge_.pairs.size()); }

  // Heights of the edges' vertices in mm, of displacements (3 #V).
  Eigen::VectorXd UpperHeights(const Eigen::VectorXd& displacements) const {
    return upper_.transpose() * displacements;
  }
  Eigen::VectorXd LowerHeights(const Eigen::VectorXd& displacements) const {
    return lower_.transpose() * displacements;
  }

  // Css^-1 in Pa mm^2 per mm, #pairs by #pairs, symmetric to the bit.
  Eigen::MatrixXd Stiffness() const;
  // K^-1 S at these vertices: 3 #vertices by #pairs, a vertex' coordinates in turn. Errors: those
  // of ElasticContact::Respond, Cancelled.
  absl::StatusOr<Eigen::MatrixXd> ForceColumns(const std::vector<int32_t>& vertices,
                                               const Cancellation& cancellation = {}) const;

  // C - Cus Css^-1 Cus^T, #rows by #rows, symmetric to the bit, positive semi-definite.
  const Eigen::MatrixXd& compliance() const { return compliance_; }
  // q + Cus Css^-1 r.
  Eigen::VectorXd Gaps(const Eigen::VectorXd& gaps, const Eigen::VectorXd& raise) const {
    return gaps + across_ * raise;
  }
  // K^-1 (N^T l + S s), 3 #V in mm. Errors: those of ElasticContact::Respond.
  absl::StatusOr<Eigen::VectorXd> Displacements(const Eigen::VectorXd& raise,
                                                const Eigen::VectorXd& forces) const;

 private:
  LipSeal(const LipEdge& edge, const ElasticContact& contact);

  // Calls take(first pair, K^-1 S of some pairs, 3 #V by their number) until all were taken.
  absl::Status SolveForPairs(
      const std::function<void(Eigen::Index first, const Eigen::MatrixXd& responses)>& take,
      const Cancellation& cancellation) const;
  absl::Status Condense(const Cancellation& cancellation);
  absl::Status CheckPairsMove(const Eigen::MatrixXd& seal_compliance) const;
  absl::Status CheckRowsMove() const;

  const LipEdge edge_;
  const ElasticContact& contact_;
  SparseMatrix upper_;                          // `up` at the upper edge, 3 #V by #pairs
  SparseMatrix lower_;                          // S
  Eigen::LLT<Eigen::MatrixXd> seal_stiffness_;  // Css^-1
  Eigen::MatrixXd across_;                      // Cus Css^-1, #rows by #pairs
  Eigen::MatrixXd compliance_;
};

}  // namespace tissueform
