// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include <Eigen/Core>
#include <Eigen/QR>

#include "core/base/cancellation.h"
#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// A unilateral row whose gap is at most this is closed in an answer: positions may have been
// rounded to single precision, 3e-5 mm in a head.
inline constexpr double kClosedGapMm = 1e-4;

// The contact rows that hold an answer, by their places in the constraint set, rising: the
// bilateral and the closed ones. `rest` and `deformed` are #V by 3, mm. Where `normals_turn`, those
// on a handle's bone turn with its pose, as in the neo-Hookean model.
std::vector<int32_t> HeldRows(const ConstraintSet& constraints, const Positions& rest,
                              absl::Span<const HandlePose> poses, const Positions& deformed,
                              bool normals_turn);

// Directions of the contact rows that hold an answer, N^T (3 #V by #rows), see HeldRows.
SparseMatrix HeldDirections(const ConstraintSet& constraints, const Positions& rest,
                            absl::Span<const HandlePose> poses, const Positions& deformed,
                            bool normals_turn);

// The small change x of an answer under forces f while the rows that hold it stay as they are:
//   K x = f - N^T l,   N x = 0,   l = S^+ N K^-1 f,   S = N K^-1 N^T.
// S may be singular: rows may ask for the same. Whether other rows open or close is not asked.
class HeldResponse {
 public:
  // `system` must outlive it; constrained unknowns are held at zero. Costs a back-substitution a
  // row. Errors: those of DirichletSystem::Solve, Cancelled.
  static absl::StatusOr<HeldResponse> Create(const DirichletSystem& system,
                                             const SparseMatrix& directions,
                                             const Cancellation& cancellation);

  // `forces` and the answer are 3 #V by k. Errors: those of DirichletSystem::Solve.
  absl::StatusOr<Eigen::MatrixXd> Respond(const Eigen::MatrixXd& forces) const;

 private:
  HeldResponse(const DirichletSystem& system, const SparseMatrix& directions)
      : system_(&system), directions_(directions) {}
  absl::StatusOr<Eigen::MatrixXd> SolveFree(const Eigen::MatrixXd& forces) const;

  const DirichletSystem* system_;
  SparseMatrix directions_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> compliance_;  // S
};

}  // namespace tissueform
