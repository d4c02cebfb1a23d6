// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include <Eigen/Cholesky>

#include "core/base/types.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// A Dirichlet system whose prescribed unknowns can be released one after another without a new
// factor: the values of released unknowns are found from their own equations, by the Schur
// complement that the system leaves on them, a dense matrix with a row for each. A new unknown
// costs a back-substitution, so this is for some hundreds of them.
//
// One thread at a time.
class ReleasableSystem {
 public:
  // As DirichletSystem::Create, with its errors.
  static absl::StatusOr<std::unique_ptr<ReleasableSystem>> Create(
      const SparseMatrix& K, std::vector<int32_t> prescribed,
      const DirichletSystem::Options& options);

  // Releases all unknowns that are prescribed now and not in `prescribed`, which is rising.
  // Errors: InvalidArgument (an unknown that was not prescribed, or was released already; nothing
  // is released then), FailedPrecondition (not positive definite any more: too much is released).
  absl::Status KeepOnly(const std::vector<int32_t>& prescribed);

  // As DirichletSystem::Solve: `values` is in the order of those that are prescribed now.
  absl::StatusOr<Eigen::MatrixXd> Solve(const Eigen::MatrixXd& rhs, const Eigen::MatrixXd& values);

  Eigen::Index num_prescribed() const { return static_cast<Eigen::Index>(kept_.size()); }
  // See DirichletSystem::node_order.
  std::vector<int32_t> node_order() const { return system_->node_order(); }
  Eigen::Index num_released() const { return static_cast<Eigen::Index>(released_.size()); }

 private:
  explicit ReleasableSystem(const SparseMatrix& K) : K_(K) {}

  // (K x)_r for the released unknowns, a row for each.
  Eigen::MatrixXd ForcesOnReleased(const Eigen::MatrixXd& x) const;
  absl::Status GrowSchurComplement(size_t first_new);

  const SparseMatrix K_;
  std::unique_ptr<DirichletSystem> system_;  // with all unknowns prescribed that ever were

  std::vector<int32_t> first_prescribed_;  // in the order of system_
  std::vector<int32_t> kept_;              // places in first_prescribed_, rising
  std::vector<int32_t> released_;          // places in first_prescribed_, as they were released
  Eigen::MatrixXd schur_complement_;       // #released by #released, lower triangle
  Eigen::LLT<Eigen::MatrixXd> schur_factor_;
};

}  // namespace tissueform
