// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// The benchmark program: ours against its peers in one process, in turns.

#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/algorithm/container.h"
#include "absl/status/statusor.h"

#include "client/cli/shared/command_line.h"
#include "client/cli/shared/companion.h"
#include "client/lab/benchmarks/bench_options.h"
#include "client/lab/benchmarks/benchmark_report.h"
#include "client/lab/benchmarks/deformation_benchmark.h"
#include "client/lab/benchmarks/evaluation.h"
#include "client/lab/benchmarks/frame_benchmark.h"
#include "client/lab/benchmarks/linear_solver_benchmark.h"
#include "client/lab/benchmarks/memory_measurement.h"
#include "client/lab/benchmarks/process_benchmark.h"
#include "core/base/atomic_file.h"
#include "core/base/instruction_set.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"

namespace tissueform::benchmarks {
namespace {

using FrameBenchmarkList = std::vector<std::unique_ptr<FrameBenchmark>>;

// An elastic factor of the large bar would not fit into memory.
absl::StatusOr<FrameBenchmarkList> FrameBenchmarks(const TestBar& bar, int threads,
                                                   const std::vector<InstructionSet>& sets) {
  std::vector<FrameBenchmark::Kind> kinds = {FrameBenchmark::Kind::kBasis};
  if (bar.number != kLargeBar) {
    kinds.insert(kinds.end(),
                 {FrameBenchmark::Kind::kBasisThreeHandles, FrameBenchmark::Kind::kElastic,
                  FrameBenchmark::Kind::kElasticContact, FrameBenchmark::Kind::kNeoHookean});
  }
  FrameBenchmarkList benchmarks;
  for (const FrameBenchmark::Kind kind : kinds) {
    TF_ASSIGN_OR_RETURN(std::unique_ptr<FrameBenchmark> benchmark,
                        FrameBenchmark::Create(bar, kind, threads, sets));
    benchmarks.push_back(std::move(benchmark));
  }
  return benchmarks;
}

// The rows of one bar. What it holds is given back when it returns.
absl::StatusOr<std::vector<BenchmarkRow>> MeasureTimes(const TestBar& bar,
                                                       const BenchOptions& options,
                                                       const std::vector<InstructionSet>& sets) {
  TF_ASSIGN_OR_RETURN(const auto solvers,
                      LinearSolverBenchmark::Create(bar, bar.number != kLargeBar));
  TF_ASSIGN_OR_RETURN(const auto deformation,
                      DeformationBenchmark::Create(bar, *solvers, options.threads));
  TF_ASSIGN_OR_RETURN(const auto frames, FrameBenchmarks(bar, options.threads, sets));
  std::vector<TimedWork> work = deformation->work();
  work.insert(work.end(), solvers->work().begin(), solvers->work().end());
  for (const auto& frame : frames) {
    work.insert(work.end(), frame->work().begin(), frame->work().end());
  }
  TF_ASSIGN_OR_RETURN(const PartSeconds medians, InterleavedMedians(work, options.repetitions));
  std::vector<BenchmarkRow> rows = deformation->Rows(medians);
  for (BenchmarkRow& row : solvers->Rows(medians)) {
    rows.push_back(std::move(row));
  }
  for (const auto& frame : frames) {
    for (BenchmarkRow& row : frame->Rows(medians)) rows.push_back(std::move(row));
  }
  for (BenchmarkRow& row : rows) {
    row.mesh = bar.name;
    row.vertices = bar.mesh.num_vertices();
    row.tets = bar.mesh.num_tets();
  }
  return rows;
}

absl::Status MeasureBar(int number, const BenchOptions& options, BenchmarkReport* report) {
  TF_ASSIGN_OR_RETURN(const TestBar bar, MakeTestBar(number));
  TF_ASSIGN_OR_RETURN(const std::vector<BenchmarkRow> rows,
                      MeasureTimes(bar, options, report->instruction_sets));
  for (const BenchmarkRow& row : rows) {
    std::cout << RowText(row) << "\n";
    report->rows.push_back(row);
  }
  TF_ASSIGN_OR_RETURN(MemoryUse memory, MeasureMemory(bar, options.threads));
  std::cout << MemoryText(memory) << std::endl;
  report->memory.push_back(std::move(memory));
  return absl::OkStatus();
}

absl::Status MeasureProcesses(int number, const BenchOptions& options, BenchmarkReport* report) {
  TF_ASSIGN_OR_RETURN(BenchmarkRow row,
                      MeasureAgainstCalculix(number, options.repetitions, options.threads));
  std::cout << RowText(row) << std::endl;
  report->rows.push_back(std::move(row));
  return absl::OkStatus();
}

absl::Status Run(const BenchOptions& options) {
  if (!options.json.empty()) {
    TF_RETURN_IF_ERROR(CheckWritable(options.json));
  }
  SetBlasThreads(1);
  BenchmarkReport report;
  report.threads = options.threads;
  report.repetitions = options.repetitions;
  for (const InstructionSet set : SupportedInstructionSets()) {
    if (absl::c_linear_search(options.instruction_sets, InstructionSetName(set))) {
      report.instruction_sets.push_back(set);
    }
  }
  const ScopedInstructionSet active(report.instruction_sets.front());
  std::cout << CircumstancesText(report) << "\n\n" << RowsHeading() << std::endl;
  for (const int number : options.meshes) {
    TF_RETURN_IF_ERROR(number > kLargeBar ? MeasureProcesses(number, options, &report)
                                          : MeasureBar(number, options, &report));
  }
  report.growth = GrowthExponents(report.rows);
  report.targets = EvaluateTargets(report);
  std::cout << ClosingText(report);
  return options.json.empty() ? absl::OkStatus()
                              : WriteFileAtomically(options.json, ReportJson(report));
}

}  // namespace
}  // namespace tissueform::benchmarks

int main(int argc, char** argv) {
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    auto options = std::make_shared<tissueform::BenchOptions>();
    CLI::App* command =
        app.add_subcommand(tissueform::kBenchCommand.name, tissueform::kBenchCommand.description);
    tissueform::AddBenchOptions(*command, options.get());
    command->callback(
        [options, work] { *work = [options] { return tissueform::benchmarks::Run(*options); }; });
  });
}
