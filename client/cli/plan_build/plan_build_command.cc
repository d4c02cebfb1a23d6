// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/plan_build_command.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"
#include <sys/resource.h>

#include "client/cli/plan_build/ending_signals.h"
#include "client/cli/plan_build/plan_build_inputs.h"
#include "client/cli/plan_build/stage_times.h"
#include "client/cli/shared/version.h"
#include "core/base/atomic_file.h"
#include "core/base/atomic_folder.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_building/plan_build_call.h"

namespace tissueform {
namespace {

struct PlanBuildArguments {
  PlanBuildInputs inputs;
  std::string stats;
  int threads = 0;
  bool no_pictures = false;
};

// The folder appears all at once, and holds no times: they go elsewhere.
absl::Status CheckStatsFile(const PlanBuildArguments& arguments) {
  if (arguments.stats.empty()) return absl::OkStatus();
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path out = fs::weakly_canonical(fs::absolute(arguments.inputs.out, error), error);
  const fs::path inside =
      fs::weakly_canonical(fs::absolute(arguments.stats, error), error).lexically_relative(out);
  if (!inside.empty() && *inside.begin() != "..") {
    return absl::FailedPreconditionError(absl::StrCat(
        "--stats ", arguments.stats, " is in the folder of --out; name a file elsewhere"));
  }
  return CheckWritable(arguments.stats);
}

// Of this process, or of its largest child: what a machine must have, at least.
int64_t PeakBytes() {
  int64_t kibibytes = 0;
  for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    kibibytes = std::max<int64_t>(kibibytes, usage.ru_maxrss);
  }
  return kibibytes * 1024;
}

absl::Status WriteStatsFile(const std::string& path, const StageTimes& times, int threads) {
  nlohmann::ordered_json stats = {
      {"version", kVersion},       {"notice", "research software, not a medical device"},
      {"threads", threads},        {"total_seconds", times.TotalSeconds()},
      {"peak_bytes", PeakBytes()}, {"stages", nlohmann::ordered_json::array()}};
  for (const StageTimes::Stage& stage : times.stages()) {
    stats["stages"].push_back({{"stage", stage.name}, {"seconds", stage.seconds}});
  }
  return WriteFileAtomically(path, stats.dump(2) + "\n");
}

// All or nothing: when it has returned an error nothing is left.
absl::StatusOr<PlanBuildAnswer> BuildIntoFolder(const PlanBuildArguments& arguments,
                                                const EndingSignals& signals) {
  TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(arguments.inputs.out));
  StageTimes times;
  TF_ASSIGN_OR_RETURN(
      PlanBuildAnswer made,
      CallPlanBuild({.ct = arguments.inputs.ct,
                     .recipe = arguments.inputs.recipe,
                     .surfaces = arguments.inputs.surfaces,
                     .labels = arguments.inputs.labels,
                     .folder = folder.path(),
                     .folder_name = arguments.inputs.out,
                     .threads = arguments.threads,
                     .pictures = !arguments.no_pictures},
                    {.on_progress = [&times](absl::string_view stage,
                                             double done) { times.Begin(stage, done); },
                     .cancel = signals.descriptor()}));
  times.End();
  if (!arguments.stats.empty()) {
    TF_RETURN_IF_ERROR(WriteStatsFile(arguments.stats, times, arguments.threads));
  }
  TF_RETURN_IF_ERROR(folder.Publish());
  return made;
}

absl::Status RunPlanBuild(PlanBuildArguments arguments) {
  TF_RETURN_IF_ERROR(CheckFillable(arguments.inputs.out));
  TF_RETURN_IF_ERROR(CheckStatsFile(arguments));
  if (arguments.threads == 0) arguments.threads = AvailableProcessors();
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<EndingSignals> signals, EndingSignals::Catch());
  const absl::StatusOr<PlanBuildAnswer> outcome = BuildIntoFolder(arguments, *signals);
  if (absl::IsCancelled(outcome.status())) signals->EndByArrived();
  TF_RETURN_IF_ERROR(outcome.status());
  absl::PrintF("%s", outcome->text);
  return CheckReady(arguments.inputs, outcome->ready, outcome->defects);
}

constexpr char kFooter[] =
    "A recipe is a JSON file that states which bone moves and how; a minimal one:\n"
    "  {\"format\": \"tissueform-recipe\", \"version\": 1,\n"
    "   \"segments\": [{\"name\": \"mandible\", \"osteotomy\": \"bssro\",\n"
    "                 \"pose\": {\"translation_mm\": [0, -6, 0]}}]}\n"
    "(lower jaw 6 mm forward; osteotomies: bssro, le_fort_1, genioplasty; mm, DICOM LPS). All "
    "other "
    "keys have defaults: docs/recipe-format.md. Requirements for a CT: docs/ct-input.md.\n\n"
    "DIR gets plan.json, head.vtu, segments/NAME.stl, report.html, report.json and pictures/, all "
    "or nothing: after an error or Ctrl-C there is no folder. A plan that misses a quality "
    "requirement "
    "is\nkept, but it is not ready: report.json states so, and the exit code is 1 unless "
    "--accept-defects is given.\n\n"
    "Examples:\n"
    "  tissueform plan build --ct series/ --recipe recipe.json --out head\n"
    "  tissueform plan build --ct head.nrrd --recipe recipe.json --out head --no-pictures\n"
    "  tissueform plan build --surfaces surfaces.json --out head\n"
    "  tissueform plan build --ct series/ --labels bones.seg.nrrd --recipe recipe.json --out head\n"
    "  tissueform plan build --ct cd.zip --recipe recipe.json --out head\n"
    "  tissueform plan build --server HOST:PORT --ct series/ --recipe recipe.json --out head\n"
    "Bone pieces as surfaces, transforms and markups of 3D Slicer: docs/bring-your-own.md.\n"
    "Exit codes: 0 done, 1 the work failed or the plan is not ready, 2 wrong use, 128 + signal "
    "when ended by one.";

// Only for the help: with this word main() leaves the command to the program that speaks with
// servers.
void AddServerWord(CLI::App* build) {
  build
      ->add_option(
          "--server",
          "build on this server; its options: tissueform plan build --server HOST:PORT --help")
      ->type_name("HOST:PORT");
}

}  // namespace

void AddPlanBuildCommand(CLI::App& app, CommandWork* work) {
  auto arguments = std::make_shared<PlanBuildArguments>();
  CLI::App* build =
      app.add_subcommand("build", "build a plan from a CT of a head, or from its surfaces");
  AddPlanBuildInputs(build, &arguments->inputs);
  AddServerWord(build);
  build
      ->add_option("--threads", arguments->threads,
                   "threads (default 0: one per processor); does not affect the "
                   "plan")
      ->check(CLI::Range(0, 1024));
  build->add_option("--stats", arguments->stats,
                    "JSON file for the seconds of every stage and the memory; not in DIR");
  build->add_flag("--no-pictures", arguments->no_pictures,
                  "report without pictures: needs no display and no Xvfb");
  build->footer(kFooter);
  build->callback([arguments, work] { *work = [arguments] { return RunPlanBuild(*arguments); }; });
}

}  // namespace tissueform
