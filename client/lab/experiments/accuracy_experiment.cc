// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/accuracy_experiment.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/lab/accuracy/accuracy_case_list.h"
#include "client/lab/accuracy/accuracy_figure.h"
#include "client/lab/accuracy/accuracy_run.h"
#include "client/lab/accuracy/accuracy_table.h"
#include "client/lab/accuracy/movement_table.h"
#include "client/lab/experiments/calculix_folder.h"
#include "client/lab/experiments/locking_experiment.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"

namespace tissueform {
namespace {

// The planning default: pictures and the summary are of this one.
constexpr double kShownPoissonRatio = 0.45;

bool IsChosen(const ExperimentOptions& options, const std::string& name) {
  return options.cases.empty() ||
         std::find(options.cases.begin(), options.cases.end(), name) != options.cases.end();
}

// Builds all cases before the first is solved, so that a missing plan is reported at once.
absl::StatusOr<std::vector<AccuracyCase>> ChosenCases(const ExperimentOptions& options) {
  std::vector<AccuracyCase> cases;
  for (const std::string& name : AccuracyCaseNames()) {
    if (!IsChosen(options, name)) continue;
    TF_ASSIGN_OR_RETURN(AccuracyCase problem, CreateAccuracyCase(name, options.find_plan));
    cases.push_back(std::move(problem));
  }
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
  CsvTable movements = MovementTable();
  CsvTable summary = AccuracySummary();
  CsvTable place_summary = PlaceSummary();
  CsvTable movement_summary = MovementSummary();

  absl::Status Write(const ExperimentOptions& options) const {
    TF_RETURN_IF_ERROR(all.WriteCsv(options.Path("accuracy.csv")));
    TF_RETURN_IF_ERROR(movements.WriteCsv(options.Path("accuracy_movements.csv")));
    return WriteFileAtomically(
        options.Path("accuracy_summary.md"),
        absl::StrCat("Mean / max in mm\n\n", summary.Markdown(),
                     "\np50 / p95 / p99 / max in mm to CalculiX neo-Hookean\n\n",
                     place_summary.Markdown(),
                     "\nForward / up in mm: foremost vertex; mean of the place\n\n",
                     movement_summary.Markdown(), "\n", kCsvNotice, "\n"));
  }
};

absl::StatusOr<AccuracySweep> RunCase(const AccuracyCase& problem, const std::string& scratch,
                                      const ExperimentOptions& options, Tables* tables) {
  AccuracySweep sweep;
  sweep.name = problem.name;
  TF_ASSIGN_OR_RETURN(sweep.results,
                      RunAccuracyCase(problem, problem.poisson_ratios, scratch, options.on_step));
  AddAccuracyRows(problem, sweep.results, &tables->all);
  AddMovementRows(problem, sweep.results, &tables->movements);
  const AccuracyResult& shown = ShownResult(sweep.results);
  AddSummaryRows(problem, shown, &tables->summary);
  AddPlaceSummaryRows(problem, shown, &tables->place_summary);
  AddMovementSummaryRows(problem, shown, &tables->movement_summary);
  if (const ModelAnswer* reference = shown.Reference("calculix_neo_hookean")) {
    sweep.largest_displacement_mm = LargestDisplacement(problem, *reference);
    TF_RETURN_IF_ERROR(DrawAccuracyCase(
        problem, shown, options.Path(absl::StrCat("accuracy_", problem.name, ".png"))));
  }
  return sweep;
}

absl::Status RunCases(const std::vector<AccuracyCase>& cases, const ExperimentOptions& options) {
  const CalculixFolder scratch(options.Path("accuracy_scratch"));
  Tables tables;
  std::vector<AccuracySweep> sweeps;
  for (const AccuracyCase& problem : cases) {
    TF_ASSIGN_OR_RETURN(AccuracySweep sweep, RunCase(problem, scratch.path(), options, &tables));
    // Heads are solved at two ratios, which make no curve.
    if (sweep.results.size() > 2) sweeps.push_back(std::move(sweep));
  }
  TF_RETURN_IF_ERROR(tables.Write(options));
  if (sweeps.empty()) return absl::OkStatus();
  return DrawPoissonRatios(sweeps, options.Path("accuracy_nu.png"));
}

}  // namespace

absl::Status RunAccuracyExperiment(const ExperimentOptions& options) {
  SetBlasThreads(1);  // CalculiX gets one thread too
  TF_ASSIGN_OR_RETURN(const std::vector<AccuracyCase> cases, ChosenCases(options));
  if (!cases.empty()) TF_RETURN_IF_ERROR(RunCases(cases, options));
  return IsChosen(options, kLockingCase) ? RunLockingExperiment(options) : absl::OkStatus();
}

}  // namespace tissueform
