// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/contact/lcp_solver.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace tissueform {
namespace {

// Rounding of a gap, relative to the sizes of the numbers that it is the sum of.
constexpr double kGapRounding = 1e-14;

// A pivot below this part of its diagonal entry is rounding: the row moves with earlier ones.
constexpr double kDependentPivot = 1e-13;

// Exchanges of all violating rows that may pass without reducing their number.
constexpr int kBlockPatience = 5;

constexpr int kFirstSweeps = 16;

// Four sums, so that the compiler may use vector registers without changing the result.
double DotOfRows(const double* a, const double* b, size_t size) {
  double sums[4] = {0, 0, 0, 0};
  size_t i = 0;
  for (; i + 4 <= size; i += 4) {
    for (size_t lane = 0; lane < 4; ++lane) sums[lane] += a[i + lane] * b[i + lane];
  }
  for (; i < size; ++i) sums[0] += a[i] * b[i];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

void AddMultiple(double factor, const double* a, size_t size, double* sum) {
  for (size_t i = 0; i < size; ++i) sum[i] += factor * a[i];
}

}  // namespace

LcpSolver::LcpSolver(std::span<const double> C, size_t num_rows, const LcpOptions& options)
    : C_(C), num_rows_(num_rows), options_(options), factor_(num_rows * num_rows) {
  root_diagonal_.reserve(num_rows);
  for (size_t row = 0; row < num_rows; ++row) root_diagonal_.push_back(std::sqrt(Diagonal(row)));
  for (std::vector<int32_t>* rows : {&factored_, &violations_, &exchanged_, &solution_.active}) {
    rows->reserve(num_rows);
  }
  active_multipliers_.resize(num_rows);
  swept_.resize(num_rows);
  solution_.multipliers.resize(num_rows);
  solution_.gaps_mm.resize(num_rows);
}

const LcpSolution& LcpSolver::SolveFrom(std::span<const double> q,
                                        std::span<const int32_t> active) {
  solution_.active.assign(active.begin(), active.end());
  return Solve(q);
}

const LcpSolution& LcpSolver::Solve(std::span<const double> q) {
  q_ = q;
  solution_.method = LcpMethod::kActiveSet;
  solution_.active_set_steps = 0;
  solution_.sweeps = 0;
  bool converged = RunActiveSet();
  if (!converged) {
    solution_.method = LcpMethod::kGaussSeidel;
    converged = RunGaussSeidel();
  }
  for (double& multiplier : solution_.multipliers) multiplier = std::max(multiplier, 0.0);
  solution_.kkt_residual_mm = Residual();
  solution_.converged = converged && std::isfinite(solution_.kkt_residual_mm);
  return solution_;
}

bool LcpSolver::RunActiveSet() {
  size_t fewest_violations = num_rows_ + 1;
  int patience = kBlockPatience;
  while (solution_.active_set_steps < options_.max_active_set_steps) {
    ++solution_.active_set_steps;
    SolveOnActiveRows();
    if (violations_.empty()) return true;
    if (violations_.size() < fewest_violations) {
      fewest_violations = violations_.size();
      patience = kBlockPatience;
    } else if (patience > 0) {
      --patience;
    } else {
      // One at a time, always the last: this rule never comes back to an earlier set.
      Exchange(violations_.size() - 1);
      continue;
    }
    Exchange(0);
  }
  return false;
}

void LcpSolver::SolveOnActiveRows() {
  Factorize();
  SolveWithFactor();
  UpdateGaps();
  CollectViolations();
}

void LcpSolver::Factorize() {
  std::vector<int32_t>& active = solution_.active;
  const auto kept = std::mismatch(active.begin(), active.end(), factored_.begin(), factored_.end());
  const auto first_new = static_cast<size_t>(std::distance(active.begin(), kept.first));
  factored_.resize(first_new);
  for (size_t i = first_new; i < active.size(); ++i) {
    if (AppendToFactor(active[i])) factored_.push_back(active[i]);
  }
  active.assign(factored_.begin(), factored_.end());
}

// False if the row depends on those in the factor.
bool LcpSolver::AppendToFactor(int32_t row) {
  const size_t place = factored_.size();
  const double* const from = RowOfC(static_cast<size_t>(row));
  double* const to = FactorRow(place);
  for (size_t j = 0; j < place; ++j) {
    const double* const earlier = FactorRow(j);
    to[j] = (from[factored_[j]] - DotOfRows(to, earlier, j)) / earlier[j];
  }
  const double diagonal = Diagonal(static_cast<size_t>(row));
  const double pivot = diagonal - DotOfRows(to, to, place);
  if (!(pivot > kDependentPivot * diagonal)) return false;
  to[place] = std::sqrt(pivot);
  return true;
}

void LcpSolver::SolveWithFactor() {
  const size_t size = factored_.size();
  std::vector<double>& x = active_multipliers_;
  for (size_t i = 0; i < size; ++i) {
    const double* const row = FactorRow(i);
    x[i] = (-q_[factored_[i]] - DotOfRows(row, x.data(), i)) / row[i];
  }
  for (size_t i = size; i-- > 0;) {
    const double* const row = FactorRow(i);
    x[i] /= row[i];
    AddMultiple(-x[i], row, i, x.data());
  }
  std::fill(solution_.multipliers.begin(), solution_.multipliers.end(), 0.0);
  for (size_t i = 0; i < size; ++i) solution_.multipliers[factored_[i]] = x[i];
}

void LcpSolver::UpdateGaps() {
  std::copy(q_.begin(), q_.end(), solution_.gaps_mm.begin());
  for (size_t row = 0; row < num_rows_; ++row) {
    const double multiplier = solution_.multipliers[row];
    if (multiplier != 0) {
      AddMultiple(multiplier, RowOfC(row), num_rows_, solution_.gaps_mm.data());
    }
  }
}

// C is positive definite: |C_ij| <= sqrt(C_ii C_jj) bounds what rounding adds to gap i.
void LcpSolver::UpdateToleranceScale() {
  tolerance_scale_ = 0;
  for (size_t row = 0; row < num_rows_; ++row) {
    tolerance_scale_ += root_diagonal_[row] * std::abs(solution_.multipliers[row]);
  }
}

void LcpSolver::CollectViolations() {
  UpdateToleranceScale();
  violations_.clear();
  size_t next_active = 0;
  for (size_t row = 0; row < num_rows_; ++row) {
    const double tolerance_mm =
        kGapRounding * (std::abs(q_[row]) + root_diagonal_[row] * tolerance_scale_);
    const bool is_active = next_active < solution_.active.size() &&
                           solution_.active[next_active] == static_cast<int32_t>(row);
    next_active += is_active ? 1 : 0;
    const double value_mm =
        is_active ? Diagonal(row) * solution_.multipliers[row] : solution_.gaps_mm[row];
    if (value_mm < -tolerance_mm) violations_.push_back(static_cast<int32_t>(row));
  }
}

// Active violating rows become inactive and inactive ones active.
void LcpSolver::Exchange(size_t first_violation) {
  exchanged_.clear();
  std::set_symmetric_difference(solution_.active.begin(), solution_.active.end(),
                                violations_.begin() + static_cast<std::ptrdiff_t>(first_violation),
                                violations_.end(), std::back_inserter(exchanged_));
  solution_.active.swap(exchanged_);
}

bool LcpSolver::RunGaussSeidel() {
  std::fill(solution_.multipliers.begin(), solution_.multipliers.end(), 0.0);
  std::copy(q_.begin(), q_.end(), solution_.gaps_mm.begin());
  int sweeps_until_polish = kFirstSweeps;
  while (solution_.sweeps < options_.max_sweeps) {
    ++solution_.sweeps;
    Sweep();
    const bool is_last = solution_.sweeps == options_.max_sweeps;
    if (solution_.sweeps < sweeps_until_polish && !is_last) continue;
    sweeps_until_polish *= 2;
    if (PolishSweeps()) return true;
  }
  return false;
}

void LcpSolver::Sweep() {
  for (size_t row = 0; row < num_rows_; ++row) {
    const double multiplier = solution_.multipliers[row];
    const double next = std::max(0.0, multiplier - solution_.gaps_mm[row] / Diagonal(row));
    if (next == multiplier) continue;
    AddMultiple(next - multiplier, RowOfC(row), num_rows_, solution_.gaps_mm.data());
    solution_.multipliers[row] = next;
  }
}

// A direct solve on the rows that the sweeps have found active. If it violates a condition, the
// sweeps go on from where they were.
bool LcpSolver::PolishSweeps() {
  std::copy(solution_.multipliers.begin(), solution_.multipliers.end(), swept_.begin());
  solution_.active.clear();
  for (size_t row = 0; row < num_rows_; ++row) {
    if (swept_[row] > 0) solution_.active.push_back(static_cast<int32_t>(row));
  }
  SolveOnActiveRows();
  if (violations_.empty()) return true;
  std::copy(swept_.begin(), swept_.end(), solution_.multipliers.begin());
  UpdateGaps();
  return false;
}

double LcpSolver::Residual() const {
  double largest = 0;
  for (size_t row = 0; row < num_rows_; ++row) {
    const double value_mm =
        std::abs(std::min(solution_.gaps_mm[row], Diagonal(row) * solution_.multipliers[row]));
    if (std::isnan(value_mm)) return value_mm;
    largest = std::max(largest, value_mm);
  }
  return largest;
}

}  // namespace tissueform
