// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/option_checks.h"

#include <cmath>
#include <filesystem>
#include <map>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "core/planning/model_names.h"

namespace tissueform {
namespace {

CLI::Validator Ending(const std::string& ending, const std::string& form) {
  const auto check = [ending](std::string& path) {
    return std::filesystem::path(path).extension() == ending ? std::string()
                                                             : path + " must end with " + ending;
  };
  return {check, form, ending + " ending"};
}

std::string NonFinite(const std::string& text) {
  double value = 0;
  return absl::SimpleAtod(text, &value) && !std::isfinite(value) ? text + " is not a finite number"
                                                                 : "";
}

void AddSeal(CLI::App* command, LipSealUse use, bool* seal) {
  if (use == LipSealUse::kComputed) {
    command->add_flag("--seal", *seal,
                      "keep lips closed that are closed in the CT, unless the mouth is opened; "
                      "only linear_elastic with contact (docs/lips.md)");
    return;
  }
  command
      ->add_flag_callback("--seal",
                          [] {
                            throw CLI::ValidationError(
                                "--seal",
                                "this command does not compute the lip seal; use tissueform "
                                "deform, plan fit, run or drag with --seal");
                          })
      ->group("");  // not in --help
}

}  // namespace

CLI::Validator VtuEnding() { return Ending(".vtu", "OUT.vtu"); }
CLI::Validator VtpEnding() { return Ending(".vtp", "FILE.vtp"); }

void AddPlanOptions(CLI::App* command, PlanReadOptions* options, LipSealUse seal) {
  command->add_flag("--allow-outside", options->allow_outside,
                    "allow a mesh outside the plan's folder");
  command
      ->add_option("--contact", options->resolve.contact,
                   "of a plan with contact rows: on: tissue slides and the lips part; off: tissue "
                   "sticks and the lips are one piece")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"on", true}, {"off", false}})
                      .description("{on,off}"))
      ->default_str("on");
  AddSeal(command, seal, &options->resolve.seal);
}

absl::Status CheckSeal(const std::string& file, const ResolveOptions& options, const Plan& plan) {
  if (!options.seal) return absl::OkStatus();
  if (!options.contact) {
    return absl::InvalidArgumentError(
        "--seal needs lips that are parted, and --contact off joins them; leave one of the two "
        "out");
  }
  if (!plan.lip_edge) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--seal: plan ", file,
        " has no \"seal\" in \"contact\": it is older, of the planner, or its lips are not parted "
        "or apart in the CT; build it again with \"lips\": {\"part\": true}, or leave --seal out"));
  }
  if (plan.model == DeformationModel::kLinearElastic) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--seal: the model ", ModelName(plan.model),
      " does not compute the lip seal; set \"model\" of the plan to \"linear_elastic\""));
}

void AddSolverThreads(CLI::App* command, const std::string& when, int* threads) {
  constexpr int kMaxOfOpenBlas = 64;  // as Debian builds it
  command
      ->add_option("--solver-threads", *threads,
                   when +
                       "threads for the dense kernels of a factorization; more than one is "
                       "faster only for large meshes on an idle machine, and the last digits of "
                       "the result then depend on the number of threads and on the machine")
      ->check(CLI::Range(1, kMaxOfOpenBlas))
      ->capture_default_str();
}

// CLI11's ranges take "nan" for a number inside, and some have no upper end.
void RefuseNonFinite(CLI::App* app) {
  for (CLI::Option* option : app->get_options()) {
    if (absl::StartsWith(option->get_type_name(), "FLOAT")) option->check(NonFinite, "");
  }
  for (CLI::App* command : app->get_subcommands([](const CLI::App*) { return true; })) {
    RefuseNonFinite(command);
  }
}

}  // namespace tissueform
