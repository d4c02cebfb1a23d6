// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_command.h"

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/outcome/cohort_list.h"
#include "client/cli/outcome/cohort_results.h"
#include "client/cli/outcome/cohort_runs.h"
#include "client/cli/outcome/cohort_tables.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/planning/model_names.h"

namespace tissueform {
namespace {

struct CohortArguments {
  std::string list;
  CohortOptions options;
};

void PrintSummary(const nlohmann::ordered_json& json, const std::string& out) {
  for (const auto& row : json["distances"]) {
    const bool is_shown = row["operation"] == json["distances"][0]["operation"] &&
                          row["movement"] == "real" && row["region"] == "face";
    if (!is_shown) continue;
    absl::PrintF("%-15s  face: mean %.2f mm, SD %.2f, median %.2f, 90 %% below %.2f (n = %d)\n",
                 row["model"].get<std::string>(), row["mean_mm"].get<double>(),
                 row["sd_mm"].get<double>(), row["median_mm"].get<double>(),
                 row["p90_mm"].get<double>(), row["n"].get<int>());
  }
  absl::PrintF("report: %s/cohort.html\n", out);
}

// deviations-MODEL.json of each model that has enough figures. One of an earlier run is removed.
absl::Status WriteDeviations(const CohortResults& results, const std::string& out) {
  for (const std::string& model : KnownModelNames()) {
    const std::string path = absl::StrCat(out, "/deviations-", model, ".json");
    const nlohmann::ordered_json json = DeviationFileJson(results, model);
    if (json.empty()) {
      std::error_code ignored;
      std::filesystem::remove(path, ignored);
    } else {
      TF_RETURN_IF_ERROR(WriteFileAtomically(path, json.dump(2) + "\n"));
    }
  }
  return absl::OkStatus();
}

absl::Status WriteReports(const CohortResults& results, const std::string& out) {
  const nlohmann::ordered_json json = CohortJson(results);
  TF_RETURN_IF_ERROR(WriteFileAtomically(out + "/cohort.json", json.dump(2) + "\n"));
  TF_RETURN_IF_ERROR(WriteCohortCsv(out + "/cohort.csv", results));
  TF_RETURN_IF_ERROR(WriteFileAtomically(out + "/cohort.html", CohortHtml(results, json)));
  TF_RETURN_IF_ERROR(WriteDeviations(results, out));
  PrintSummary(json, out);
  if (results.refused.empty()) return absl::OkStatus();
  return absl::AbortedError(
      absl::StrFormat("%d of %d cases failed, the first is %s: %s; %s/cohort.html lists them",
                      results.refused.size(), results.refused.size() + results.compared.size(),
                      results.refused[0].id, results.refused[0].reason, out));
}

absl::Status RunCohortCommand(const CohortArguments& arguments) {
  TF_ASSIGN_OR_RETURN(const std::vector<CohortCase> cases, ReadCohortList(arguments.list));
  TF_ASSIGN_OR_RETURN(const std::vector<CohortRun> runs, RunCohort(cases, arguments.options));
  TF_ASSIGN_OR_RETURN(const CohortResults results,
                      ReadCohortResults(cases, runs, arguments.options.out));
  return WriteReports(results, arguments.options.out);
}

constexpr char kFooter[] =
    "LIST.csv has a header and one patient a line, with paths relative to its folder:\n\n"
    "  case,operation,pre,post\n"
    "  p01,bsso,p01/plan.json,p01/after.nrrd\n"
    "  p02,bimax,p02/plan.json,p02/after\n\n"
    "More columns: post_bone, post_labels, post_recipe, post_axes, as the options of outcome.\n"
    "Only `case` and `operation` (letters, digits, - and _) are written: use no patient's name.\n"
    "Each patient is a process of its own; results are in DIR/cases. The same command again\n"
    "continues after an interruption: it repeats only cases that failed, or whose inputs, options\n"
    "or program changed. DIR gets cohort.html, cohort.json and cohort.csv, and from 5 patients on\n"
    "deviations-MODEL.json, which `tissueform deform --deviations` takes; see docs/outcome.md.\n"
    "Research use. Not a medical device.\n\n"
    "Example:\n"
    "  tissueform outcome cohort patients.csv --out cohort --jobs 4 --memory-gib 24\n"
    "Exit codes: 0 all cases compared, 1 some failed (the report is written), 2 wrong use.";

void AddLimits(CLI::App* command, CohortOptions* options) {
  command
      ->add_option("--jobs", options->jobs,
                   "patients at a time (default 0: one a processor, as memory allows)")
      ->check(CLI::Range(0, 256));
  command
      ->add_option("--memory-gib", options->memory_gib,
                   "memory of all processes together, shared evenly (default: three quarters of "
                   "this machine's)")
      ->check(CLI::Range(0.1, 65536.0));
}

}  // namespace

CLI::App* AddCohortCommand(CLI::App* outcome, CommandWork* work) {
  auto arguments = std::make_shared<CohortArguments>();
  CohortOptions* options = &arguments->options;
  CLI::App* command =
      outcome->add_subcommand("cohort",
                              "compare many patients, with statistics by region, model "
                              "and operation");
  command->add_option("LIST.csv", arguments->list, "the patients: case, operation, pre, post")
      ->required();
  command
      ->add_option("--out", options->out,
                   "folder for the results: a new one, or that of an earlier run to continue")
      ->required();
  AddLimits(command, options);
  command->add_option("--model", options->models, "only these models (default: all)")
      ->check(CLI::IsMember(KnownModelNames()));
  command->add_flag("--accept-findings", options->accept_findings,
                    "compare in spite of an open mouth or swelling");
  command->add_flag("--calibrate", options->calibrate,
                    "choose settings of linear_elastic by leave-one-out cross-validation; takes "
                    "some minutes a patient");
  command->add_flag("--no-pictures", options->no_pictures,
                    "reports without pictures: needs no display and no Xvfb");
  command->footer(kFooter);
  command->callback(
      [arguments, work] { *work = [arguments] { return RunCohortCommand(*arguments); }; });
  return command;
}

}  // namespace tissueform
