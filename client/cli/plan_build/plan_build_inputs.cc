// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/plan_build/plan_build_inputs.h"

#include "absl/strings/str_cat.h"

namespace tissueform {

void AddPlanBuildInputs(CLI::App* command, PlanBuildInputs* inputs) {
  auto* ct = command->add_option(
      "--ct", inputs->ct,
      "folder of a DICOM series, a study or a CD, or a DICOM file, or a volume (.nii "
      ".nii.gz .nrrd "
      ".nhdr .mha .mhd), or a zip of one of these");
  auto* recipe =
      command->add_option("--recipe", inputs->recipe, "the recipe (docs/recipe-format.md)");
  ct->needs(recipe);
  recipe->needs(ct);
  auto* group = command->add_option_group("input", "a CT with a recipe, or surfaces");
  group->add_options(ct);
  group
      ->add_option("--surfaces", inputs->surfaces,
                   "instead of a CT and a recipe: JSON file that names the surfaces of skin and "
                   "bones (docs/bring-your-own.md), or a zip of it with them")
      ->excludes(recipe);
  group->require_option(1);
  command
      ->add_option(
          "--labels", inputs->labels,
          "label map of this CT (.seg.nrrd .nrrd .nii .nii.gz .mha, DICOM SEG, or a folder with a "
          "mask for each structure, or a zip of it); its "
          "bones, teeth and hollows take the place of what thresholds find "
          "(docs/bring-your-own.md)")
      ->needs(ct);
  command->add_option("--out", inputs->out, "folder for the plan: a new or an empty one")
      ->required();
  command->add_flag("--accept-defects", inputs->accept_defects,
                    "exit code 0 even if the plan misses a quality requirement; the report still "
                    "states that it is not ready");
}

absl::Status CheckReady(const PlanBuildInputs& inputs, bool ready, const std::string& defects) {
  if (ready || inputs.accept_defects) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the plan in ", inputs.out, " is not ready: ", defects, "; see ", inputs.out,
                   "/report.html, or pass --accept-defects to continue"));
}

}  // namespace tissueform
