// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/plan_build_command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"
#include <sys/resource.h>

#include "client/cli/plan_build/folder_worker.h"
#include "client/cli/plan_build/stage_times.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/version.h"
#include "client/plan_report/cautions.h"
#include "client/plan_report/plan_measures.h"
#include "client/plan_report/plan_report.h"
#include "client/rendering/virtual_display.h"
#include "core/base/atomic_file.h"
#include "core/base/atomic_folder.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/linear_solvers/blas_threads.h"
#include "core/mesh_payload/sha256.h"
#include "core/plan_building/plan_builder.h"

namespace tissueform {
namespace {

// Of the whole work's time: what building, without writing and the report, takes.
constexpr double kBuildShare = 0.8;

struct PlanBuildArguments {
  std::string ct;
  std::string recipe;
  std::string out;
  std::string stats;
  int threads = 0;
  bool no_pictures = false;
};

std::string Sha256OfFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  return Sha256Hex({text});
}

// The folder appears all at once, and holds no times: they go elsewhere.
absl::Status CheckStatsFile(const PlanBuildArguments& arguments) {
  if (arguments.stats.empty()) return absl::OkStatus();
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path out = fs::weakly_canonical(fs::absolute(arguments.out, error), error);
  const fs::path inside =
      fs::weakly_canonical(fs::absolute(arguments.stats, error), error).lexically_relative(out);
  if (!inside.empty() && *inside.begin() != "..") {
    return absl::FailedPreconditionError(absl::StrCat(
        "--stats ", arguments.stats, " lies in the folder of --out; name a file elsewhere"));
  }
  return CheckWritable(arguments.stats);
}

StageFunction Within(StageTimes* times, double from, double to) {
  return [times, from, to](absl::string_view stage, double fraction) {
    if (stage == "done") return;
    times->Begin(stage, from + (to - from) * fraction);
  };
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

std::string QualityText(const PlanBuild& build) {
  std::string failed;
  for (const QualityCheck& check : CheckQuality(build, MeasurePlan(build))) {
    if (check.passed) continue;
    absl::StrAppend(&failed, failed.empty() ? "" : "; ", check.name, ": ", check.measured, ", not ",
                    check.required);
  }
  return failed.empty() ? "all quality requirements are met"
                        : absl::StrCat("NOT all quality requirements are met: ", failed);
}

// What is printed when all went well.
std::string Outcome(const PlanBuildArguments& arguments, const PlanBuild& build) {
  std::string text = absl::StrFormat("plan    %s/plan.json: %d vertices, %d tets\n", arguments.out,
                                     build.mesh->mesh.num_vertices(), build.mesh->mesh.num_tets());
  for (const BuiltSegment& segment : build.segments) {
    absl::StrAppendFormat(&text, "  handle  %s (%s): %.1f cm3 of bone\n", segment.cut.name,
                          OsteotomyKindName(segment.cut.kind), segment.volume_mm3 / 1000);
  }
  absl::StrAppendFormat(&text, "report  %s/report.html: %s\n", arguments.out, QualityText(build));
  for (const std::string& caution : Cautions(build)) {
    absl::StrAppend(&text, "mind    ", caution, "\n");
  }
  absl::StrAppendFormat(
      &text, "the plan is ready: tissueform deform %s/plan.json --out after.vtu\n", arguments.out);
  return text;
}

absl::StatusOr<std::string> BuildInto(const PlanBuildArguments& arguments, const Recipe& recipe,
                                      const std::string& folder) {
  // As deform does: the last digits would depend on their number, and with them what the trial of
  // the planned move finds torn. Threads that wait for each other also cost more than they give.
  SetBlasThreads(1);
  StageTimes times;
  std::unique_ptr<VirtualDisplay> display;
  if (!arguments.no_pictures) {
    // First: before any thread, and so that a missing program is told before the work.
    TF_ASSIGN_OR_RETURN(display, VirtualDisplay::Open());
  }
  TF_ASSIGN_OR_RETURN(const PlanBuild build, BuildPlan(arguments.ct, recipe,
                                                       {.threads = arguments.threads,
                                                        .tell = Within(&times, 0, kBuildShare)}));
  times.Begin("writing the plan", kBuildShare);
  TF_RETURN_IF_ERROR(WritePlan(build, folder));
  TF_RETURN_IF_ERROR(WritePlanReport(build,
                                     {.program_version = kVersion,
                                      .recipe_sha256 = Sha256OfFile(arguments.recipe),
                                      .pictures = !arguments.no_pictures,
                                      .tell = Within(&times, kBuildShare + 0.05, 1)},
                                     folder));
  times.End();
  if (!arguments.stats.empty()) {
    TF_RETURN_IF_ERROR(WriteStatsFile(arguments.stats, times, arguments.threads));
  }
  return Outcome(arguments, build);
}

absl::Status RunPlanBuild(PlanBuildArguments arguments) {
  TF_RETURN_IF_ERROR(CheckFillable(arguments.out));
  TF_RETURN_IF_ERROR(CheckStatsFile(arguments));
  TF_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipe(arguments.recipe));
  if (arguments.threads == 0) arguments.threads = AvailableProcessors();
  TF_ASSIGN_OR_RETURN(const std::string outcome,
                      FillFolderAtomically(arguments.out, [&](const std::string& folder) {
                        return BuildInto(arguments, recipe, folder);
                      }));
  absl::PrintF("%s", outcome);
  return absl::OkStatus();
}

constexpr char kFooter[] =
    "A recipe is a JSON file that says which bone moves and where to; the smallest one:\n"
    "  {\"format\": \"tissueform-recipe\", \"version\": 1,\n"
    "   \"segments\": [{\"name\": \"mandible\", \"osteotomy\": \"bssro\",\n"
    "                 \"pose\": {\"translation_mm\": [0, -6, 0]}}]}\n"
    "(lower jaw 6 mm forward; osteotomies: bssro, le_fort_1, genioplasty; mm, DICOM LPS). All "
    "other "
    "keys have defaults: docs/recipe-format.md. What a CT must be: docs/ct-input.md.\n\n"
    "DIR gets plan.json, head.vtu, segments/NAME.stl, report.html, report.json and pictures/, all "
    "or nothing: an error or Ctrl-C leaves no folder.\n\n"
    "Examples:\n"
    "  tissueform plan build --ct series/ --recipe recipe.json --out head\n"
    "  tissueform plan build --ct head.nrrd --recipe recipe.json --out head --no-pictures\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use, 128 + signal when ended by one.";

}  // namespace

void AddPlanBuildCommand(CLI::App& app, CommandWork* work) {
  auto arguments = std::make_shared<PlanBuildArguments>();
  CLI::App* build = app.add_subcommand(kPlanBuildCommand.name, kPlanBuildCommand.description);
  build
      ->add_option("--ct", arguments->ct,
                   "folder of a DICOM series or a file of it, or a volume (.nii .nii.gz .nrrd "
                   ".nhdr .mha .mhd)")
      ->required();
  build->add_option("--recipe", arguments->recipe, "the recipe (docs/recipe-format.md)")
      ->required();
  build->add_option("--out", arguments->out, "folder for the plan: a new or an empty one")
      ->required();
  build
      ->add_option("--threads", arguments->threads,
                   "for resampling; 0, the default: all processors. The plan does not depend on it")
      ->check(CLI::Range(0, 1024));
  build->add_option("--stats", arguments->stats,
                    "JSON file for the seconds of every stage and the memory; not in DIR");
  build->add_flag("--no-pictures", arguments->no_pictures,
                  "report without pictures: needs no display and no Xvfb");
  build->footer(kFooter);
  build->callback([arguments, work] { *work = [arguments] { return RunPlanBuild(*arguments); }; });
}

}  // namespace tissueform
