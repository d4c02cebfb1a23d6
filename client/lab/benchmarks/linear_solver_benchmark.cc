// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/linear_solver_benchmark.h"

#include <chrono>
#include <cstdint>
#include <thread>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include <Eigen/SparseCholesky>

#include "client/lab/benchmarks/direct_cholmod.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mesh/operators/laplacian.h"

namespace tissueform::benchmarks {
namespace {

constexpr int kSolvesPerRepetition = 5;
// OpenBLAS's threads look for work for some 30 ms before they rest: not in what is timed next.
constexpr std::chrono::milliseconds kUntilBlasThreadsRest{100};
constexpr char kOurs[] = "ours";
constexpr char kEigen[] = "Eigen SimplicialLDLT";

SparseMatrix Columns(const SparseMatrix& matrix, const std::vector<int32_t>& columns) {
  SparseMatrix selection(matrix.cols(), static_cast<Eigen::Index>(columns.size()));
  for (size_t j = 0; j < columns.size(); ++j) {
    selection.insert(columns[j], static_cast<Eigen::Index>(j)) = 1;
  }
  return matrix * selection;
}

std::vector<int32_t> FreeVertices(const TestBar& bar) {
  std::vector<bool> is_prescribed(static_cast<size_t>(bar.mesh.num_vertices()), false);
  for (const int32_t vertex : bar.ends.constrained()) {
    is_prescribed[static_cast<size_t>(vertex)] = true;
  }
  std::vector<int32_t> free;
  for (int32_t i = 0; i < bar.mesh.num_vertices(); ++i) {
    if (!is_prescribed[static_cast<size_t>(i)]) {
      free.push_back(i);
    }
  }
  return free;
}

// The right-hand side was made from the rest shape, so that is the answer: every solver shows that
// it solves the problem before it is timed.
absl::Status CheckAnswer(const std::string& solver, const Eigen::MatrixXd& answer,
                         const Eigen::MatrixXd& expected) {
  const double difference = (answer - expected).cwiseAbs().maxCoeff();
  if (!(difference <= 1e-9 * expected.cwiseAbs().maxCoeff())) {
    return absl::InternalError(absl::StrCat(solver, " is off by ", difference));
  }
  return absl::OkStatus();
}

// Times the two halves of a preparation.
PartSeconds Prepare(const std::function<void()>& analyse, const std::function<void()>& factorise) {
  const double analyse_seconds = SecondsOf(analyse);
  const double factorise_seconds = SecondsOf(factorise);
  return {{"analyze", analyse_seconds},
          {"factorize", factorise_seconds},
          {"prepare", analyse_seconds + factorise_seconds}};
}

}  // namespace

LinearSolverBenchmark::LinearSolverBenchmark(const TestBar& bar)
    : bar_(bar), problem_([&bar] {
        Problem problem;
        problem.K = CotangentLaplacian(bar.mesh, bar.stiffness);
        problem.rhs = problem.K * bar.mesh.positions();
        problem.values = bar.mesh.positions()(bar.ends.constrained(), Eigen::all);
        const std::vector<int32_t> free = FreeVertices(bar);
        const SparseMatrix free_rows = Columns(problem.K, free).transpose();  // K is symmetric
        problem.A = Columns(free_rows, free);
        problem.reduced_rhs = problem.rhs(free, Eigen::all) -
                              Columns(free_rows, bar.ends.constrained()) * problem.values;
        return problem;
      }()) {}

absl::StatusOr<std::unique_ptr<LinearSolverBenchmark>> LinearSolverBenchmark::Create(
    const TestBar& bar, bool with_eigen) {
  auto benchmark = absl::WrapUnique(new LinearSolverBenchmark(bar));
  TF_RETURN_IF_ERROR(benchmark->AddOurs());
  TF_RETURN_IF_ERROR(benchmark->AddCholmod());
  if (with_eigen) {
    TF_RETURN_IF_ERROR(benchmark->AddEigen());
  } else {
    benchmark->contenders_.push_back(kEigen);
  }
  if (AvailableProcessors() > 1) {
    benchmark->AddOursWithMoreBlasThreads();
  }
  return benchmark;
}

absl::StatusOr<PartSeconds> LinearSolverBenchmark::PrepareOurs() {
  ours_.reset();
  const Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(ours_, DirichletSystem::Create(problem_.K, bar_.ends.constrained(), {}));
  return PartSeconds{{"analyze", ours_->factorization().analyse_seconds},
                     {"factorize", ours_->factorization().factorise_seconds},
                     {"prepare", stopwatch.Seconds()}};
}

absl::StatusOr<PartSeconds> LinearSolverBenchmark::SolveOurs() {
  const Stopwatch stopwatch;
  TF_RETURN_IF_ERROR(ours_->Solve(problem_.rhs, problem_.values).status());
  return PartSeconds{{"solve", stopwatch.Seconds()}};
}

absl::Status LinearSolverBenchmark::AddOurs() {
  TF_RETURN_IF_ERROR(PrepareOurs().status());
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd solution, ours_->Solve(problem_.rhs, problem_.values));
  TF_RETURN_IF_ERROR(CheckAnswer("DirichletSystem", solution, bar_.mesh.positions()));
  reduced_solution_ = solution(ours_->free(), Eigen::all);
  AddContender(
      kOurs, [this] { return PrepareOurs(); }, [this] { return SolveOurs(); });
  return absl::OkStatus();
}

absl::Status LinearSolverBenchmark::AddCholmod() {
  const auto cholmod = std::make_shared<DirectCholmod>();
  const auto prepare = [this, cholmod] {
    return Prepare([&] { cholmod->Analyse(problem_.A); }, [&] { cholmod->Factorise(problem_.A); });
  };
  prepare();
  TF_RETURN_IF_ERROR(
      CheckAnswer("direct CHOLMOD", cholmod->Solve(problem_.reduced_rhs), reduced_solution_));
  AddContender("CHOLMOD", prepare, [this, cholmod] {
    return PartSeconds{{"solve", SecondsOf([&] { cholmod->Solve(problem_.reduced_rhs); })}};
  });
  return absl::OkStatus();
}

absl::Status LinearSolverBenchmark::AddEigen() {
  const auto ldlt = std::make_shared<Eigen::SimplicialLDLT<SparseMatrix>>();
  const auto prepare = [this, ldlt] {
    return Prepare([&] { ldlt->analyzePattern(problem_.A); }, [&] { ldlt->factorize(problem_.A); });
  };
  prepare();
  TF_RETURN_IF_ERROR(CheckAnswer(kEigen, ldlt->solve(problem_.reduced_rhs), reduced_solution_));
  AddContender(kEigen, prepare, [this, ldlt] {
    return PartSeconds{{"solve", SecondsOf([&] {
                          const Eigen::MatrixXd solution = ldlt->solve(problem_.reduced_rhs);
                        })}};
  });
  return absl::OkStatus();
}

void LinearSolverBenchmark::AddOursWithMoreBlasThreads() {
  const int threads = AvailableProcessors();
  const auto with_threads = [threads](const std::function<absl::StatusOr<PartSeconds>()>& run) {
    SetBlasThreads(threads);
    absl::StatusOr<PartSeconds> seconds = run();
    SetBlasThreads(1);
    std::this_thread::sleep_for(kUntilBlasThreadsRest);
    return seconds;
  };
  AddContender(
      absl::StrCat("ours, ", threads, " BLAS threads"),
      [this, with_threads] { return with_threads([this] { return PrepareOurs(); }); },
      [this, with_threads] { return with_threads([this] { return SolveOurs(); }); });
}

void LinearSolverBenchmark::AddContender(const std::string& name,
                                         std::function<absl::StatusOr<PartSeconds>()> prepare,
                                         std::function<absl::StatusOr<PartSeconds>()> solve) {
  contenders_.push_back(name);
  work_.push_back({name, 1, std::move(prepare)});
  work_.push_back({name, kSolvesPerRepetition, std::move(solve)});
}

std::vector<BenchmarkRow> LinearSolverBenchmark::Rows(const PartSeconds& medians) const {
  const std::pair<const char*, const char*> kWorkAndPart[] = {{"analyze", "analyze"},
                                                              {"factorize", "factorize"},
                                                              {"analyze + factorize", "prepare"},
                                                              {"solve 3", "solve"}};
  std::vector<BenchmarkRow> rows;
  for (const auto& [work, part] : kWorkAndPart) {
    for (size_t i = 1; i < contenders_.size(); ++i) {
      BenchmarkRow row;
      row.work = work;
      row.ours_seconds = medians.at(absl::StrCat(kOurs, "/", part));
      row.peer = contenders_[i];
      const auto peer = medians.find(absl::StrCat(contenders_[i], "/", part));
      if (peer != medians.end()) {
        row.peer_seconds = peer->second;
      }
      row.bytes = ours_->bytes_held();
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

}  // namespace tissueform::benchmarks
