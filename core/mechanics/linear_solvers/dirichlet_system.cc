// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/dirichlet_system.h"

#include <random>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

constexpr int32_t kNotInSystem = -1;

absl::Status CheckPrescribed(const SparseMatrix& K, const std::vector<int32_t>& prescribed) {
  int32_t previous = -1;
  for (const int32_t index : prescribed) {
    if (index <= previous || index >= K.rows()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "prescribed unknown ", index, " is out of order or outside 0 to ", K.rows() - 1));
    }
    previous = index;
  }
  return absl::OkStatus();
}

enum class BlockPart { kWhole, kLowerTriangle };

// The entries of K in the rows for which row_number is not kNotInSystem, in the given columns. Row
// numbers rise with the rows.
SparseMatrix ExtractBlock(const SparseMatrix& K, const std::vector<int32_t>& row_number,
                          Eigen::Index num_rows, const std::vector<int32_t>& columns,
                          BlockPart part) {
  const auto is_in_block = [part](int32_t row, Eigen::Index column) {
    return row != kNotInSystem && (part == BlockPart::kWhole || row >= column);
  };
  SparseMatrix block(num_rows, static_cast<Eigen::Index>(columns.size()));
  Eigen::Index entries = 0;
  for (Eigen::Index j = 0; j < block.cols(); ++j) {
    for (SparseMatrix::InnerIterator entry(K, columns[j]); entry; ++entry) {
      entries += is_in_block(row_number[entry.row()], j) ? 1 : 0;
    }
  }
  block.reserve(entries);
  for (Eigen::Index j = 0; j < block.cols(); ++j) {
    block.startVec(j);
    for (SparseMatrix::InnerIterator entry(K, columns[j]); entry; ++entry) {
      if (const int32_t row = row_number[entry.row()]; is_in_block(row, j)) {
        block.insertBack(row, j) = entry.value();
      }
    }
  }
  block.finalize();
  return block;
}

// An order of all nodes without those that have no number, by their numbers.
std::vector<int32_t> OrderOfFreeNodes(const std::vector<int32_t>& node_order,
                                      const std::vector<int32_t>& free_number, int b) {
  std::vector<int32_t> order;
  if (node_order.size() * static_cast<size_t>(b) != free_number.size()) return order;
  for (const int32_t node : node_order) {
    if (const int32_t number = free_number[node * b]; number != kNotInSystem) {
      order.push_back(number / b);
    }
  }
  return order;
}

// The same at every call; without a pattern that an eigenvector could be orthogonal to.
Eigen::MatrixXd RandomUnitVector(Eigen::Index size) {
  std::mt19937 generator(1);
  Eigen::MatrixXd vector(size, 1);
  for (Eigen::Index i = 0; i < size; ++i) {
    vector(i) = static_cast<double>(generator()) / std::mt19937::max() - 0.5;
  }
  return vector.normalized();
}

int64_t BytesOf(const SparseMatrix& matrix) {
  return matrix.nonZeros() * static_cast<int64_t>(sizeof(double) + sizeof(int32_t)) +
         (matrix.outerSize() + 1) * static_cast<int64_t>(sizeof(int32_t));
}

}  // namespace

absl::StatusOr<std::unique_ptr<DirichletSystem>> DirichletSystem::Create(
    const SparseMatrix& K, const std::vector<int32_t>& prescribed, const Options& options,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckPrescribed(K, prescribed));
  auto system = absl::WrapUnique(new DirichletSystem());
  system->size_ = K.rows();
  system->entries_ = K.nonZeros();
  system->unknowns_per_node_ = options.unknowns_per_node;
  system->prescribed_ = prescribed;

  std::vector<bool> is_prescribed(K.rows(), false);
  for (const int32_t index : prescribed) {
    is_prescribed[index] = true;
  }
  for (int32_t i = 0; i < K.rows(); ++i) {
    // A vertex of no cell has an empty row; in the system it would be a zero pivot. It keeps the
    // zero of `solution`.
    const bool empty = K.outerIndexPtr()[i] == K.outerIndexPtr()[i + 1];
    if (!is_prescribed[i] && !empty) {
      system->free_.push_back(i);
    }
  }
  system->ExtractBlocks(K);
  if (system->free_.empty()) {
    return system;
  }

  TF_RETURN_IF_ERROR(cancellation.Check());
  ReportProgress(options.observer, PreparationStage::kOrdering);
  system->cholesky_ = CreateSparseCholesky(
      options.backend,
      {options.unknowns_per_node,
       OrderOfFreeNodes(options.node_order, system->FreeNumbers(), options.unknowns_per_node)});
  Stopwatch stopwatch;
  TF_RETURN_IF_ERROR(system->cholesky_->Analyze(system->free_free_));
  system->factorization_.analyse_seconds = stopwatch.Restart();
  system->factorization_.factor_bytes = system->cholesky_->factor_bytes();
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(system->factorization_.factor_bytes));
  }
  ReportProgress(options.observer, PreparationStage::kFactorising);
  stopwatch.Restart();
  TF_RETURN_IF_ERROR(system->cholesky_->Factorize(system->free_free_));
  system->factorization_.factorise_seconds = stopwatch.Restart();
  return system;
}

// Of every unknown: its place in free_, or kNotInSystem.
std::vector<int32_t> DirichletSystem::FreeNumbers() const {
  std::vector<int32_t> numbers(static_cast<size_t>(size_), kNotInSystem);
  for (size_t i = 0; i < free_.size(); ++i) {
    numbers[static_cast<size_t>(free_[i])] = static_cast<int32_t>(i);
  }
  return numbers;
}

void DirichletSystem::ExtractBlocks(const SparseMatrix& K) {
  const std::vector<int32_t> numbers = FreeNumbers();
  free_free_ = ExtractBlock(K, numbers, num_free(), free_, BlockPart::kLowerTriangle);
  free_prescribed_ = ExtractBlock(K, numbers, num_free(), prescribed_, BlockPart::kWhole);
}

absl::Status DirichletSystem::Refactorize(const SparseMatrix& K) {
  if (K.rows() != size_ || K.nonZeros() != entries_) {
    return absl::InvalidArgumentError(
        absl::StrCat("matrix has ", K.rows(), " rows with ", K.nonZeros(),
                     " entries where the one before had ", size_, " with ", entries_));
  }
  ExtractBlocks(K);
  return free_.empty() ? absl::OkStatus() : cholesky_->Factorize(free_free_);
}

absl::StatusOr<Eigen::MatrixXd> DirichletSystem::Solve(const Eigen::MatrixXd& rhs,
                                                       const Eigen::MatrixXd& values) const {
  Eigen::MatrixXd solution = Eigen::MatrixXd::Zero(size_, values.cols());
  if (!free_.empty()) {
    // Two steps: Eigen would make a temporary of the size of the product for its negative.
    Eigen::MatrixXd reduced_rhs;
    reduced_rhs.noalias() = free_prescribed_ * values;
    reduced_rhs = -reduced_rhs;
    if (rhs.rows() > 0) {
      reduced_rhs += rhs(free_, Eigen::all);
    }
    Eigen::MatrixXd reduced_solution;
    TF_RETURN_IF_ERROR(cholesky_->Solve(reduced_rhs, &reduced_solution));
    solution(free_, Eigen::all) = reduced_solution;
  }
  solution(prescribed_, Eigen::all) = values;
  return solution;
}

absl::StatusOr<double> DirichletSystem::EstimateCondition(int iterations) const {
  if (free_.empty()) {
    return 1.0;
  }
  // Power iteration on A for its largest eigenvalue, and by the factor on its inverse for one over
  // the smallest: no library's condition estimate, so both backends say the same.
  double largest = 0;
  double largest_of_inverse = 0;
  Eigen::MatrixXd x = RandomUnitVector(num_free());
  Eigen::MatrixXd image;
  for (int i = 0; i < iterations; ++i) {
    image.noalias() = free_free_.selfadjointView<Eigen::Lower>() * x;
    largest = image.norm();
    x = image / largest;
  }
  x = RandomUnitVector(num_free());
  for (int i = 0; i < iterations; ++i) {
    TF_RETURN_IF_ERROR(cholesky_->Solve(x, &image));
    largest_of_inverse = image.norm();
    x = image / largest_of_inverse;
  }
  return largest * largest_of_inverse;
}

double DirichletSystem::RelativeResidual(const Eigen::MatrixXd& rhs,
                                         const Eigen::MatrixXd& solution) const {
  if (free_.empty()) {
    return 0;
  }
  Eigen::MatrixXd right = -(free_prescribed_ * solution(prescribed_, Eigen::all));
  if (rhs.rows() > 0) {
    right += rhs(free_, Eigen::all);
  }
  const Eigen::MatrixXd free_solution = solution(free_, Eigen::all);
  const Eigen::MatrixXd residual =
      free_free_.selfadjointView<Eigen::Lower>() * free_solution - right;
  const double norm = right.norm();
  return norm > 0 ? residual.norm() / norm : residual.norm();
}

std::vector<int32_t> DirichletSystem::node_order() const {
  if (free_.empty() || cholesky_->node_order().empty()) return {};
  const int b = unknowns_per_node_;
  std::vector<int32_t> order;
  order.reserve(static_cast<size_t>(size_ / b));
  std::vector<bool> is_free(static_cast<size_t>(size_ / b), false);
  for (const int32_t node : cholesky_->node_order()) {
    order.push_back(free_[node * b] / b);
    is_free[order.back()] = true;
  }
  for (int32_t node = 0; node < size_ / b; ++node) {
    if (!is_free[node]) order.push_back(node);
  }
  return order;
}

int64_t DirichletSystem::bytes_held() const {
  const auto indices = static_cast<int64_t>(free_.size() + prescribed_.size());
  return factorization_.factor_bytes + BytesOf(free_free_) + BytesOf(free_prescribed_) +
         indices * static_cast<int64_t>(sizeof(int32_t));
}

}  // namespace tissueform
