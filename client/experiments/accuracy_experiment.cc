// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/accuracy_experiment.h"

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/experiments/accuracy_figure.h"
#include "client/experiments/accuracy_run.h"
#include "client/experiments/accuracy_table.h"
#include "client/experiments/layered_block.h"
#include "client/experiments/locking_experiment.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/linear_solvers/blas_threads.h"

namespace tissueform {
namespace {

constexpr int kBarCells = 8;
// The planning default: pictures and the summary are of this one.
constexpr double kShownPoissonRatio = 0.45;

// For CalculiX's files, some of which are large; goes with its end.
class ScratchFolder {
 public:
  explicit ScratchFolder(std::string path) : path_(std::move(path)) {
    std::error_code ignored;  // what it costs is told by the first file that cannot be written
    std::filesystem::create_directories(path_, ignored);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

absl::StatusOr<std::vector<AccuracyCase>> AllCases(const ExperimentOptions& options) {
  std::vector<AccuracyCase> cases;
  const auto add = [&](absl::StatusOr<AccuracyCase> problem) -> absl::Status {
    TF_RETURN_IF_ERROR(problem.status());
    cases.push_back(*std::move(problem));
    return absl::OkStatus();
  };
  TF_RETURN_IF_ERROR(add(BendCase(kBarCells)));
  TF_RETURN_IF_ERROR(add(TwistAndStretchCase(kBarCells)));
  TF_RETURN_IF_ERROR(add(BlockAlongCase(kLayeredBlockCells)));
  TF_RETURN_IF_ERROR(add(BlockUpCase(kLayeredBlockCells)));
  TF_RETURN_IF_ERROR(
      add(CaseOfPlan("tongue", "bundled tongue, tip turned by 20\u00b0", options.plan)));
  return cases;
}

const AccuracyResult& ShownResult(const std::vector<AccuracyResult>& results) {
  for (const AccuracyResult& result : results) {
    if (result.poisson_ratio == kShownPoissonRatio) return result;
  }
  return results.back();
}

struct Tables {
  CsvTable all = AccuracyTable();
  CsvTable summary = AccuracySummary();
};

absl::StatusOr<AccuracySweep> RunCase(const AccuracyCase& problem, const std::string& scratch,
                                      const ExperimentOptions& options, Tables* tables) {
  AccuracySweep sweep;
  sweep.name = problem.name;
  TF_ASSIGN_OR_RETURN(sweep.results,
                      RunAccuracyCase(problem, {0.0, 0.3, 0.45, 0.49}, scratch, options.tell));
  AddAccuracyRows(problem, sweep.results, &tables->all);
  const AccuracyResult& shown = ShownResult(sweep.results);
  AddSummaryRows(problem, shown, &tables->summary);
  if (const ModelAnswer* reference = shown.Reference("calculix_neo_hookean")) {
    sweep.largest_displacement_mm = LargestDisplacement(problem, *reference);
    TF_RETURN_IF_ERROR(DrawAccuracyCase(
        problem, shown, options.Path(absl::StrCat("accuracy_", problem.name, ".png"))));
  }
  return sweep;
}

}  // namespace

absl::Status RunAccuracyExperiment(const ExperimentOptions& options) {
  SetBlasThreads(1);  // CalculiX gets one thread too
  TF_ASSIGN_OR_RETURN(const std::vector<AccuracyCase> cases, AllCases(options));
  const ScratchFolder scratch(options.Path("accuracy_scratch"));
  Tables tables;
  std::vector<AccuracySweep> sweeps;
  for (const AccuracyCase& problem : cases) {
    TF_ASSIGN_OR_RETURN(AccuracySweep sweep, RunCase(problem, scratch.path(), options, &tables));
    sweeps.push_back(std::move(sweep));
  }
  TF_RETURN_IF_ERROR(tables.all.WriteCsv(options.Path("accuracy.csv")));
  TF_RETURN_IF_ERROR(
      WriteFileAtomically(options.Path("accuracy_summary.md"), tables.summary.Markdown()));
  TF_RETURN_IF_ERROR(DrawPoissonRatios(sweeps, options.Path("accuracy_nu.png")));
  return RunLockingExperiment(options);
}

}  // namespace tissueform
