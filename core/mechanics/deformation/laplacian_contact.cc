// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/laplacian_contact.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/memory/memory.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"

namespace tissueform {
namespace {

// Right-hand sides of one pass over the factor.
constexpr Eigen::Index kVerticesPerPass = 32;

}  // namespace

LaplacianContact::LaplacianContact(const ConstraintSet& constraints)
    : rows_(constraints.contact()) {
  for (size_t r = 0; r < rows_.size(); ++r) {
    (rows_[r].bilateral ? bilateral_ : unilateral_).push_back(static_cast<int32_t>(r));
    vertices_.push_back(rows_[r].vertex);
    if (rows_[r].other != ContactRow::kBone) vertices_.push_back(rows_[r].other);
  }
  std::ranges::sort(vertices_);
  vertices_.erase(std::unique(vertices_.begin(), vertices_.end()), vertices_.end());
}

absl::StatusOr<std::unique_ptr<LaplacianContact>> LaplacianContact::Create(
    const ConstraintSet& constraints, const DirichletSystem& laplacian,
    const FactorAdmission& admission, const Cancellation& cancellation) {
  auto contact = absl::WrapUnique(new LaplacianContact(constraints));
  if (contact->empty()) return contact;
  if (admission) {
    const auto vertices = static_cast<int64_t>(contact->vertices_.size());
    const auto rows = static_cast<int64_t>(contact->rows_.size());
    TF_RETURN_IF_ERROR(
        admission((vertices * vertices + 2 * rows * rows) * static_cast<int64_t>(sizeof(double))));
  }
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd of_vertices,
                      contact->VertexCompliance(laplacian, cancellation));
  TF_RETURN_IF_ERROR(contact->Eliminate(contact->RowCompliance(of_vertices)));
  return contact;
}

absl::StatusOr<Eigen::MatrixXd> LaplacianContact::VertexCompliance(
    const DirichletSystem& laplacian, const Cancellation& cancellation) const {
  const auto num_vertices = static_cast<Eigen::Index>(vertices_.size());
  Eigen::MatrixXd result(num_vertices, num_vertices);
  for (Eigen::Index first = 0; first < num_vertices; first += kVerticesPerPass) {
    TF_RETURN_IF_ERROR(cancellation.Check());
    const Eigen::Index count = std::min(kVerticesPerPass, num_vertices - first);
    Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(laplacian.num_unknowns(), count);
    for (Eigen::Index i = 0; i < count; ++i) loads(vertices_[first + i], i) = 1;
    TF_ASSIGN_OR_RETURN(
        const Eigen::MatrixXd responses,
        laplacian.Solve(loads, Eigen::MatrixXd::Zero(laplacian.num_prescribed(), count)));
    result.middleCols(first, count) = responses(vertices_, Eigen::all);
  }
  return result;
}

Eigen::MatrixXd LaplacianContact::RowCompliance(const Eigen::MatrixXd& of_vertices) const {
  const auto place = [this](int32_t vertex) {
    return std::ranges::lower_bound(vertices_, vertex) - vertices_.begin();
  };
  const auto num_rows = static_cast<Eigen::Index>(rows_.size());
  Eigen::MatrixXd result(num_rows, num_rows);
  for (Eigen::Index j = 0; j < num_rows; ++j) {
    const ContactRow& pushed = rows_[static_cast<size_t>(j)];
    Eigen::VectorXd response = of_vertices.col(place(pushed.vertex));
    if (pushed.other != ContactRow::kBone) response -= of_vertices.col(place(pushed.other));
    for (Eigen::Index i = 0; i < num_rows; ++i) {
      const ContactRow& row = rows_[static_cast<size_t>(i)];
      double moved = response[place(row.vertex)];
      if (row.other != ContactRow::kBone) moved -= response[place(row.other)];
      result(i, j) = row.normal.dot(pushed.normal) * moved;
    }
  }
  // Two solves differ in their last digits.
  return 0.5 * (result + result.transpose());
}

absl::Status LaplacianContact::Eliminate(const Eigen::MatrixXd& of_rows) {
  compliance_ = of_rows(unilateral_, unilateral_);
  if (!bilateral_.empty()) {
    held_factor_.compute(of_rows(bilateral_, bilateral_));
    const Eigen::MatrixXd coupling = of_rows(bilateral_, unilateral_);
    held_to_free_ = coupling;
    // Eigen solves nothing for no right-hand side by reading from a null pointer.
    if (unilateral_.empty()) return absl::OkStatus();
    held_to_free_ = held_factor_.solve(coupling);
    compliance_ -= coupling.transpose() * held_to_free_;
    compliance_ = (0.5 * (compliance_ + compliance_.transpose())).eval();
  }
  return CheckContactMoves(of_rows.diagonal()(unilateral_), compliance_.diagonal(), unilateral_);
}

Eigen::VectorXd LaplacianContact::Gaps(const Eigen::MatrixXd& displacements,
                                       const Eigen::VectorXd& resting_gaps) const {
  Eigen::VectorXd gaps = resting_gaps;
  for (size_t r = 0; r < rows_.size(); ++r) {
    Eigen::RowVector3d moved = displacements.row(rows_[r].vertex);
    if (rows_[r].other != ContactRow::kBone) moved -= displacements.row(rows_[r].other);
    gaps[static_cast<Eigen::Index>(r)] += moved.dot(rows_[r].normal);
  }
  return gaps;
}

Eigen::VectorXd LaplacianContact::Condense(const Eigen::VectorXd& gaps) const {
  Eigen::VectorXd condensed = gaps(unilateral_);
  if (!bilateral_.empty()) condensed -= held_to_free_.transpose() * gaps(bilateral_);
  return condensed;
}

Eigen::VectorXd LaplacianContact::Multipliers(const Eigen::VectorXd& gaps,
                                              const Eigen::VectorXd& of_unilateral) const {
  Eigen::VectorXd multipliers(gaps.size());
  multipliers(unilateral_) = of_unilateral;
  if (!bilateral_.empty()) {
    multipliers(bilateral_) =
        -held_factor_.solve(gaps(bilateral_).eval()) - held_to_free_ * of_unilateral;
  }
  return multipliers;
}

void LaplacianContact::AddLoads(const Eigen::VectorXd& multipliers, Eigen::MatrixXd* loads) const {
  for (size_t r = 0; r < rows_.size(); ++r) {
    const Eigen::RowVector3d load =
        multipliers[static_cast<Eigen::Index>(r)] * rows_[r].normal.transpose();
    loads->row(rows_[r].vertex) += load;
    if (rows_[r].other != ContactRow::kBone) loads->row(rows_[r].other) -= load;
  }
}

int64_t LaplacianContact::bytes_held() const {
  const auto held = static_cast<int64_t>(bilateral_.size());
  return (held * held + held_to_free_.size() + compliance_.size()) *
         static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
