// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/solver_times_experiment.h"

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/atomic_file.h"
#include "core/base/csv_table.h"
#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/bar_mesh.h"
#include "core/mesh/operators/laplacian.h"

namespace tissueform {
namespace {

constexpr int kFactorizations = 3;
constexpr int kSolvesEach = 5;

// Liao et al. 2009, Table 1: 3 GHz Pentium IV, TAUCS.
struct SourceRow {
  absl::string_view name;
  std::array<int, 3> cells;
  double factorise;
  double three_solves;
};
constexpr SourceRow kSource[] = {{"Test 1", {10, 10, 20}, 0.094, 0.016},
                                 {"Test 2", {10, 10, 60}, 0.438, 0.047},
                                 {"Test 3", {15, 25, 30}, 5.031, 0.234},
                                 {"Test 4", {20, 20, 50}, 7.375, 0.406},
                                 {"Test 5", {25, 25, 50}, 16.797, 0.838}};

std::string Seconds(double seconds) { return absl::StrFormat("%.4f", seconds); }

}  // namespace

absl::StatusOr<SolverTimes> TimeBar(const std::array<int, 3>& cells, int repetitions, int threads) {
  TF_ASSIGN_OR_RETURN(const TetMesh bar, BarMesh(CubeGrid(cells, 1)));
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(bar.positions()));
  const SparseMatrix L = CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()), threads);
  const Eigen::MatrixXd rhs = L * bar.positions();
  const Eigen::MatrixXd values = bar.positions()(ends.constrained(), Eigen::all);
  std::vector<double> analyse;
  std::vector<double> factorise;
  std::vector<double> solve;
  int64_t factor_bytes = 0;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    TF_ASSIGN_OR_RETURN(const auto system, DirichletSystem::Create(L, ends.constrained(), {}));
    analyse.push_back(system->factorization().analyse_seconds);
    factorise.push_back(system->factorization().factorise_seconds);
    factor_bytes = system->factorization().factor_bytes;
    for (int s = 0; s < kSolvesEach; ++s) {
      const Stopwatch stopwatch;
      TF_RETURN_IF_ERROR(system->Solve(rhs, values).status());
      solve.push_back(stopwatch.Seconds());
    }
  }
  return SolverTimes{
      .vertices = bar.num_vertices(),
      .tets = bar.num_tets(),
      .analyse = Median(analyse),
      .factorise = Median(factorise),
      .three_solves = Median(solve),
      .unknowns = bar.num_vertices() - static_cast<Eigen::Index>(ends.constrained().size()),
      .factor_bytes = factor_bytes,
      .num_factorizations = static_cast<int>(factorise.size()),
      .num_solves = static_cast<int>(solve.size())};
}

absl::Status RunSolverTimesExperiment(const ExperimentOptions& options) {
  CsvTable table({"object", "vertices", "tetrahedra", "source: factorize [s]", "analyze [s]",
                  "factorize [s]", "source: three solves [s]", "three solves [s]"});
  for (const SourceRow& row : kSource) {
    TF_ASSIGN_OR_RETURN(const SolverTimes times,
                        TimeBar(row.cells, kFactorizations, options.threads));
    table.AddRow({std::string(row.name), absl::StrCat(times.vertices), absl::StrCat(times.tets),
                  absl::StrFormat("%.3f", row.factorise), Seconds(times.analyse),
                  Seconds(times.factorise), absl::StrFormat("%.3f", row.three_solves),
                  Seconds(times.three_solves)});
  }
  TF_RETURN_IF_ERROR(table.WriteCsv(options.Path("table1.csv")));
  return WriteFileAtomically(options.Path("table1.md"), table.Markdown());
}

}  // namespace tissueform
