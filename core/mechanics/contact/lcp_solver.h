// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tissueform {

enum class LcpMethod {
  kActiveSet,    // primal-dual active set
  kGaussSeidel,  // projected Gauss-Seidel, after the active set has used up its steps
};

struct LcpOptions {
  // A step costs a solve on the active rows. Contact of lips and teeth takes two to ten.
  int max_active_set_steps = 100;
  // A sweep costs at most #rows^2 multiplications.
  int max_sweeps = 4096;
};

struct LcpSolution {
  std::vector<double> multipliers;  // l, one per row, >= 0
  std::vector<double> gaps_mm;      // g = q + C l, one per row
  std::vector<int32_t> active;      // rows whose gap is held closed, rising
  // The largest |min(g_i, C_ii l_i)| over all rows, which is zero exactly at the solution.
  double kkt_residual_mm = 0;
  bool converged = false;
  LcpMethod method = LcpMethod::kActiveSet;
  int active_set_steps = 0;
  int sweeps = 0;
};

// Solves the linear complementarity problem of frictionless contact:
//
//   g = q + C l,   g >= 0,   l >= 0,   l_i g_i = 0 for every row i,
//
// with C the compliance of the rows (mm of gap per unit of multiplier), q the gaps in mm that the
// rows would have without contact. C is positive definite, so there is one solution. The
// multipliers come from a direct solve on the active rows in rising order: they are a function of q
// and of the active set alone, to the last bit, for any start and any earlier calls.
//
// The primal-dual active set (Hintermueller, Ito, Kunisch 2002) exchanges all rows that violate a
// condition at once. If that stops reducing their number, it exchanges one row at a time, which
// always ends (Judice, Pires 1994). Projected Gauss-Seidel takes over when the steps are used up.
//
// One thread at a time. Several solvers may share C. After the first call nothing is allocated.
// Standard library only.
class LcpSolver {
 public:
  // `C` is #rows by #rows, symmetric, and outlives the solver. REQUIRES: finite numbers and a
  // positive diagonal. Rows that depend on other active rows up to rounding are left inactive.
  LcpSolver(std::span<const double> C, size_t num_rows, const LcpOptions& options = {});

  // Starts from the rows that were active in the last solution: the first time from none. The
  // reference is valid until the next call. REQUIRES: #rows numbers.
  const LcpSolution& Solve(std::span<const double> q);

  // Starts from these rows: rising, without repetition, in [0, #rows).
  const LcpSolution& SolveFrom(std::span<const double> q, std::span<const int32_t> active);

  size_t num_rows() const { return num_rows_; }

 private:
  const double* RowOfC(size_t row) const { return C_.data() + row * num_rows_; }
  const double& Diagonal(size_t row) const { return C_[row * (num_rows_ + 1)]; }
  double* FactorRow(size_t place) { return factor_.data() + place * num_rows_; }

  bool RunActiveSet();
  void SolveOnActiveRows();
  void Factorize();
  bool AppendToFactor(int32_t row);
  void SolveWithFactor();
  void UpdateGaps();
  void UpdateToleranceScale();
  void CollectViolations();
  void Exchange(size_t first_violation);

  bool RunGaussSeidel();
  void Sweep();
  bool PolishSweeps();
  double Residual() const;

  const std::span<const double> C_;
  const size_t num_rows_;
  const LcpOptions options_;
  std::vector<double> root_diagonal_;  // square roots of C_ii

  // Workspaces. The factor is that of C on the rows `factored_`, lower triangle by rows with
  // #rows numbers each: rows that stay the first ones keep their part of it.
  std::span<const double> q_;
  std::vector<double> factor_;
  std::vector<int32_t> factored_;
  std::vector<double> active_multipliers_;
  std::vector<int32_t> violations_;  // rising
  std::vector<int32_t> exchanged_;
  std::vector<double> swept_;  // multipliers of Gauss-Seidel while a direct solve is tried
  double tolerance_scale_ = 0;
  LcpSolution solution_;
};

}  // namespace tissueform
