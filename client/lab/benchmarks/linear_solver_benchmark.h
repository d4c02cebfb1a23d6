// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/benchmarks/benchmark_report.h"
#include "client/lab/benchmarks/interleaved.h"
#include "client/lab/benchmarks/test_bars.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform::benchmarks {

// Analysis, factorisation and three right-hand sides through DirichletSystem, which starts from the
// whole matrix and gathers and scatters the free unknowns; against direct CHOLMOD calls and
// Eigen::SimplicialLDLT, which are handed the reduced system, so that everything that ours does on
// top counts against it. A last peer is ours with as many BLAS threads as there are processors.
class LinearSolverBenchmark {
 public:
  // Solves once with every solver. `bar` outlives the benchmark; `with_eigen` leaves out what takes
  // minutes on the large bar.
  //
  // Errors: those of DirichletSystem; Internal when an answer is off by more than rounding.
  static absl::StatusOr<std::unique_ptr<LinearSolverBenchmark>> Create(const TestBar& bar,
                                                                       bool with_eigen);

  const std::vector<TimedWork>& work() const { return work_; }
  std::vector<BenchmarkRow> Rows(const PartSeconds& medians) const;

  // The system that was made last; another one after each repetition.
  DirichletSystem& system() const { return *ours_; }

 private:
  // What all solvers are asked, each in the form in which it takes it.
  struct Problem {
    SparseMatrix K;
    Eigen::MatrixXd rhs;          // #V by 3
    Eigen::MatrixXd values;       // #prescribed by 3
    SparseMatrix A;               // the free block of K
    Eigen::MatrixXd reduced_rhs;  // #free by 3
  };

  explicit LinearSolverBenchmark(const TestBar& bar);

  absl::StatusOr<PartSeconds> PrepareOurs();
  absl::StatusOr<PartSeconds> SolveOurs();
  absl::Status AddOurs();
  absl::Status AddCholmod();
  absl::Status AddEigen();
  void AddOursWithMoreBlasThreads();
  void AddContender(const std::string& name, std::function<absl::StatusOr<PartSeconds>()> prepare,
                    std::function<absl::StatusOr<PartSeconds>()> solve);

  const TestBar& bar_;
  const Problem problem_;
  std::unique_ptr<DirichletSystem> ours_;
  Eigen::MatrixXd reduced_solution_;     // what the peers must find
  std::vector<std::string> contenders_;  // ours first
  std::vector<TimedWork> work_;
};

}  // namespace tissueform::benchmarks
