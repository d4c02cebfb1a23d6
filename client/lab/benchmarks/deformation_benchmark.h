// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/lab/benchmarks/benchmark_report.h"
#include "client/lab/benchmarks/interleaved.h"
#include "client/lab/benchmarks/linear_solver_benchmark.h"
#include "client/lab/benchmarks/test_bars.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform::benchmarks {

// What stands around the solver: reading the bar from a .vtu, assembling, one iteration of the
// `estimated` mode and a whole answer of it. There are no peers.
class DeformationBenchmark {
 public:
  // `bar` and `solvers` outlive the benchmark; the system of `solvers` is the one that iterations
  // solve with. The file lies in a temporary folder and goes with the benchmark.
  static absl::StatusOr<std::unique_ptr<DeformationBenchmark>> Create(
      const TestBar& bar, const LinearSolverBenchmark& solvers, int threads);
  ~DeformationBenchmark();
  DeformationBenchmark(const DeformationBenchmark&) = delete;
  DeformationBenchmark& operator=(const DeformationBenchmark&) = delete;

  const std::vector<TimedWork>& work() const { return work_; }
  std::vector<BenchmarkRow> Rows(const PartSeconds& medians) const;

 private:
  DeformationBenchmark(const TestBar& bar, const LinearSolverBenchmark& solvers, int threads);

  absl::Status WriteFile();
  absl::Status PrepareIteration();
  absl::StatusOr<PartSeconds> Read();
  absl::StatusOr<PartSeconds> Assemble();
  absl::StatusOr<PartSeconds> Iterate();
  absl::StatusOr<PartSeconds> Answer();

  const TestBar& bar_;
  const LinearSolverBenchmark& solvers_;
  const int threads_;
  std::string folder_;  // empty before it is made
  std::string file_;

  // An iteration, as GradientFieldDeformer does it.
  const PiecewiseLinearElements elements_;
  const VertexCells vertex_cells_;
  Eigen::VectorXd blend_weights_;
  Eigen::MatrixXd end_displacements_;  // #constrained by 3
  Positions deformed_;                 // the answer: rotations are estimated where they matter
  CellTransforms transforms_;

  std::unique_ptr<Deformer> deformer_;
  int solves_ = 0;
  int64_t matrix_bytes_ = 0;
  std::vector<TimedWork> work_;
};

}  // namespace tissueform::benchmarks
