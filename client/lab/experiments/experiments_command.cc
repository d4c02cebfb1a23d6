// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/experiments_command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/companion.h"
#include "client/cli/shared/demo_paths.h"
#include "client/cli/shared/stage_progress.h"
#include "client/lab/accuracy/accuracy_case_list.h"
#include "client/lab/experiments/accuracy_experiment.h"
#include "client/lab/experiments/experiment.h"
#include "core/base/atomic_file.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/planning/rendering/virtual_display.h"

namespace tissueform {
namespace {

struct ExperimentsOptions {
  std::string out;
  std::vector<std::string> only;
  std::vector<std::string> cases;
  std::vector<std::string> plans;
};

std::vector<std::string> ExperimentNames() {
  std::vector<std::string> names;
  for (const Experiment& experiment : AllExperiments()) names.emplace_back(experiment.name);
  return names;
}

std::vector<std::string> CaseNames() {
  std::vector<std::string> names = AccuracyCaseNames();
  names.emplace_back(kLockingCase);
  return names;
}

std::string ExperimentList() {
  std::string list = "Experiments:\n";
  for (const Experiment& experiment : AllExperiments()) {
    absl::StrAppend(&list, "  ", experiment.name, "  ", experiment.topic, "\n");
  }
  return list;
}

bool IsChosen(const ExperimentsOptions& options, const Experiment& experiment) {
  if (options.only.empty()) return !experiment.only_when_named;
  return std::find(options.only.begin(), options.only.end(), experiment.name) != options.only.end();
}

absl::Status MakeOutFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot create the folder ", folder, ": ", error.message()));
  }
  // Asked before minutes of work, by a file that goes again.
  const std::string probe = folder + "/.tissueform-experiments";
  TF_RETURN_IF_ERROR(WriteFileAtomically(probe, ""));
  std::filesystem::remove(probe, error);
  return absl::OkStatus();
}

ExperimentOptions OptionsFor(const ExperimentsOptions& options) {
  ExperimentOptions result;
  result.folder = options.out;
  result.threads = AvailableProcessors();
  result.find_plan = FindBundledPlan;
  result.cases = options.cases;
  result.plans = options.plans;
  result.on_step = [](const std::string& line) { absl::FPrintF(stderr, "%s\n", line); };
  return result;
}

absl::Status RunExperiments(const ExperimentsOptions& options) {
  TF_RETURN_IF_ERROR(MakeOutFolder(options.out));
  // Before any thread: it changes the environment.
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<VirtualDisplay> display, VirtualDisplay::Open());
  const ExperimentOptions experiment_options = OptionsFor(options);
  for (const Experiment& experiment : AllExperiments()) {
    if (!IsChosen(options, experiment)) continue;
    const StageProgress progress(std::string(experiment.name));
    TF_RETURN_IF_ERROR(experiment.run(experiment_options));
    absl::PrintF("%s: %s -> %s\n", experiment.name, experiment.topic,
                 experiment_options.Path(experiment.name) + "*");
  }
  return absl::OkStatus();
}

}  // namespace

void AddExperimentsCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ExperimentsOptions>();
  CLI::App* command = app.add_subcommand(kExperimentsCommand.name, kExperimentsCommand.description);
  command->add_option("--out", options->out, "output folder for pictures (.png) and numbers (.csv)")
      ->required();
  command
      ->add_option("NAME,--only", options->only,
                   "only these experiments (default: all figures and the table of the paper)")
      ->check(CLI::IsMember(ExperimentNames()));
  command
      ->add_option("--case", options->cases,
                   "only these cases of the experiment accuracy (default: all)")
      ->check(CLI::IsMember(CaseNames()));
  command->add_option("--plan", options->plans,
                      "plan files that the experiment ratios measures besides the bundled heads, "
                      "each with the viewer.glb of `tissueform plan build` beside its mesh");
  command->footer(
      absl::StrCat(ExperimentList(),
                   "Example:\n"
                   "  tissueform experiments --out figures --only fig1\n"
                   "  tissueform experiments accuracy --out accuracy\n"
                   "  tissueform experiments accuracy --case head_chin --out accuracy\n"
                   "  tissueform experiments ratios --plan head/plan.json --out ratios\n"
                   "docs/experiments.md compares them with the paper, "
                   "docs/accuracy.md the models with finite elements."));
  command->callback([options, work] { *work = [options] { return RunExperiments(*options); }; });
}

}  // namespace tissueform
