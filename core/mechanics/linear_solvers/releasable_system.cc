// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/releasable_system.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Columns that go through the factor at a time: a pass is bound by reading it, and so many share
// one reading; more would only take more room.
constexpr size_t kColumnsAtATime = 32;

}  // namespace

absl::StatusOr<std::unique_ptr<ReleasableSystem>> ReleasableSystem::Create(
    const SparseMatrix& K, std::vector<int32_t> prescribed,
    const DirichletSystem::Options& options) {
  auto releasable = absl::WrapUnique(new ReleasableSystem(K));
  TF_ASSIGN_OR_RETURN(releasable->system_,
                      DirichletSystem::Create(releasable->K_, prescribed, options));
  releasable->kept_.resize(prescribed.size());
  std::iota(releasable->kept_.begin(), releasable->kept_.end(), 0);
  releasable->first_prescribed_ = std::move(prescribed);
  return releasable;
}

absl::Status ReleasableSystem::KeepOnly(const std::vector<int32_t>& prescribed) {
  std::vector<int32_t> kept;
  std::vector<int32_t> gone;
  size_t next = 0;
  for (const int32_t place : kept_) {
    const bool keeps = next < prescribed.size() && prescribed[next] == first_prescribed_[place];
    (keeps ? kept : gone).push_back(place);
    next += keeps ? 1 : 0;
  }
  if (next != prescribed.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("unknown ", prescribed[next], " is not prescribed, or out of order"));
  }
  if (gone.empty()) return absl::OkStatus();
  kept_ = std::move(kept);
  const size_t first_new = released_.size();
  released_.insert(released_.end(), gone.begin(), gone.end());
  return GrowSchurComplement(first_new);
}

Eigen::MatrixXd ReleasableSystem::ForcesOnReleased(const Eigen::MatrixXd& x) const {
  Eigen::MatrixXd forces(static_cast<Eigen::Index>(released_.size()), x.cols());
  for (Eigen::Index r = 0; r < forces.rows(); ++r) {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(x.cols());
    // A column of K is its row.
    const int32_t unknown = first_prescribed_[released_[static_cast<size_t>(r)]];
    for (SparseMatrix::InnerIterator entry(K_, unknown); entry; ++entry) {
      sum += entry.value() * x.row(entry.row());
    }
    forces.row(r) = sum;
  }
  return forces;
}

absl::Status ReleasableSystem::GrowSchurComplement(size_t first_new) {
  const auto size = static_cast<Eigen::Index>(released_.size());
  schur_complement_.conservativeResize(size, size);
  for (size_t begin = first_new; begin < released_.size(); begin += kColumnsAtATime) {
    const size_t end = std::min(begin + kColumnsAtATime, released_.size());
    const auto columns = static_cast<Eigen::Index>(end - begin);
    Eigen::MatrixXd unit =
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(first_prescribed_.size()), columns);
    for (size_t r = begin; r < end; ++r) {
      unit(released_[r], static_cast<Eigen::Index>(r - begin)) = 1;
    }
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd answer, system_->Solve({}, unit));
    const Eigen::MatrixXd forces = ForcesOnReleased(answer);
    const auto first_column = static_cast<Eigen::Index>(begin);
    schur_complement_.middleCols(first_column, columns) = forces;
    // The new rows of the old columns, which are the same numbers: only the lower triangle is read.
    schur_complement_.block(first_column, 0, columns, first_column) =
        forces.topRows(first_column).transpose();
  }
  schur_factor_.compute(schur_complement_);
  if (schur_factor_.info() != Eigen::Success) {
    return WithReason(absl::FailedPreconditionError("linear system is not positive definite once "
                                                    "these unknowns are released"),
                      ErrorReason::kNotPositiveDefinite);
  }
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> ReleasableSystem::Solve(const Eigen::MatrixXd& rhs,
                                                        const Eigen::MatrixXd& values) {
  Eigen::MatrixXd all =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(first_prescribed_.size()), values.cols());
  all(kept_, Eigen::all) = values;
  TF_ASSIGN_OR_RETURN(Eigen::MatrixXd solution, system_->Solve(rhs, all));
  if (released_.empty()) return solution;
  // With the released ones at zero their equations are missed by so much; then with the values that
  // make it good.
  Eigen::MatrixXd missing = -ForcesOnReleased(solution);
  if (rhs.rows() > 0) {
    for (size_t r = 0; r < released_.size(); ++r) {
      missing.row(static_cast<Eigen::Index>(r)) += rhs.row(first_prescribed_[released_[r]]);
    }
  }
  const Eigen::MatrixXd found = schur_factor_.solve(missing);
  all(released_, Eigen::all) = found;
  return system_->Solve(rhs, all);
}

}  // namespace tissueform
