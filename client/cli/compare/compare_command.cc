// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/compare/compare_command.h"

#include <filesystem>
#include <memory>
#include <string>

#include "client/cli/compare/compare_files.h"
#include "client/cli/compare/compare_models.h"
#include "client/cli/shared/option_checks.h"
#include "core/base/parallel_for.h"
#include "core/planning/model_names.h"

namespace tissueform {
namespace {

constexpr char kFooter[] =
    "Examples:\n"
    "  tissueform compare predicted.vtu reference.vtu\n"
    "  tissueform compare predicted.vtu reference.vtu --by anatomy --out difference.vtu\n"
    "  tissueform compare plan.json --models gradient_field,arap --csv models.csv\n"
    "  tissueform compare plan.json --reference linear_elastic --out compared\n"
    "For a plan, the chosen models (default: all) run in this process on one mesh "
    "and\n"
    "are compared with the reference. Percentiles are nearest-rank; skin means the boundary's "
    "vertices.";

bool EndsWith(const std::string& path, const char* ending) {
  return std::filesystem::path(path).extension() == ending;
}

// Wrong use when options of one kind of comparison are given to the other.
void CheckUse(const CLI::App& command, const CompareOptions& options) {
  const bool of_models = EndsWith(options.a, ".json");
  const auto refuse = [&](const char* option, const char* why) {
    if (command.count(option) > 0) throw CLI::ValidationError(option, why);
  };
  if (of_models) {
    refuse("B", "a plan's models are compared with each other, not with a file");
    refuse("--by", "applies to two results; a plan's regions are its fixed and handle vertices");
    if (EndsWith(options.out, ".vtu")) {
      throw CLI::ValidationError("--out", "one file per model is written into a folder; " +
                                              options.out + " looks like a file name");
    }
    return;
  }
  if (options.b.empty()) {
    throw CLI::ValidationError("B", "is required: two results, or one plan (.json)");
  }
  for (const char* option :
       {"--models", "--reference", "--solver-threads", "--allow-outside", "--contact"}) {
    refuse(option, "applies to a plan (.json)");
  }
  if (!options.out.empty() && !EndsWith(options.out, ".vtu")) {
    throw CLI::ValidationError("--out", options.out + " must end with .vtu");
  }
}

void AddModelOptions(CLI::App* command, CompareOptions* options) {
  command
      ->add_option("--models", options->models,
                   "for a plan: models to compare, separated by commas (default: all)")
      ->delimiter(',')
      ->check(CLI::IsMember(KnownModelNames()));
  command->add_option("--reference", options->reference, "for a plan: the reference model")
      ->check(CLI::IsMember(KnownModelNames()))
      ->capture_default_str();
  command
      ->add_option("--threads", options->threads,
                   "for a plan: number of threads; does not affect the result")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  AddSolverThreads(command, "for a plan: ", &options->solver_threads);
  AddPlanOptions(command, &options->reading);
}

}  // namespace

void AddCompareCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<CompareOptions>();
  options->threads = AvailableProcessors();
  CLI::App* command = app.add_subcommand(
      "compare", "distance between two results, or between the models of one plan, in mm");
  command->add_option("A", options->a, "a result (.vtu), or a plan (.json)")->required();
  command->add_option("B", options->b, "another result with the same vertices");
  command->add_option("--by", options->by,
                      "also report each value of this point array of A separately");
  command->add_option(
      "--out", options->out,
      "for results: write A with point arrays distance_mm and difference_mm (B - A) "
      "to this .vtu; for a plan: one such file per model, into this folder");
  command->add_option("--csv", options->csv, "also write the figures to this file");
  command->add_flag("--json", options->json, "print the figures as JSON");
  AddModelOptions(command, options.get());
  command->footer(kFooter);
  command->callback([command, options, work] {
    CheckUse(*command, *options);
    *work = [options] {
      return EndsWith(options->a, ".json") ? CompareModels(*options) : CompareFiles(*options);
    };
  });
}

}  // namespace tissueform
