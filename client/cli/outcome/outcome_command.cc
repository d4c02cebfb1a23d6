// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/outcome_command.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/outcome/cohort_command.h"
#include "client/cli/outcome/outcome_json.h"
#include "client/cli/outcome/outcome_pictures.h"
#include "client/cli/outcome/post_operative.h"
#include "client/cli/outcome/pre_operative.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/stage_progress.h"
#include "core/base/atomic_file.h"
#include "core/base/atomic_folder.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/model_names.h"
#include "core/planning/outcome/outcome.h"
#include "core/planning/rendering/virtual_display.h"

namespace tissueform {
namespace {

struct OutcomeArguments {
  std::string pre;
  PostOperativeInput post;
  std::string out;
  std::vector<std::string> models;
  bool accept_findings = false;
  bool calibrate = false;
  bool no_pictures = false;
};

absl::Status CheckArguments(const OutcomeArguments& arguments) {
  const bool is_surface = NamesSurface(arguments.post.scan);
  if (!arguments.post.bone.empty() && !is_surface) {
    return absl::InvalidArgumentError(
        "--post-bone goes with a surface as --post; bone of a CT is found in the CT");
  }
  if (is_surface && (!arguments.post.labels.empty() || !arguments.post.recipe.empty())) {
    return absl::InvalidArgumentError(
        "--post-labels and --post-recipe go with a CT as --post, not with a surface");
  }
  return CheckFillable(arguments.out);
}

// All models without a choice, the plan's first: it is the one that is drawn.
absl::StatusOr<std::vector<DeformationModel>> ChosenModels(const OutcomeArguments& arguments,
                                                           DeformationModel of_plan) {
  const std::vector<std::string> names =
      arguments.models.empty() ? KnownModelNames() : arguments.models;
  std::vector<DeformationModel> models;
  for (const std::string& name : names) {
    TF_ASSIGN_OR_RETURN(const DeformationModel model, ModelFromName(name));
    models.push_back(model);
  }
  std::stable_partition(models.begin(), models.end(),
                        [&](DeformationModel model) { return model == of_plan; });
  return models;
}

absl::StatusOr<Outcome> Compare(const OutcomeArguments& arguments, const PreOperativePlan& pre) {
  TF_ASSIGN_OR_RETURN(const std::vector<DeformationModel> models,
                      ChosenModels(arguments, pre.problem.deformer.model));
  TF_ASSIGN_OR_RETURN(const PostOperativeHead post, ReadPostOperative(arguments.post));
  std::optional<StageProgress> progress;
  OutcomeOptions options;
  options.models = models;
  options.threads = arguments.post.threads;
  options.accept_findings = arguments.accept_findings;
  options.settings = arguments.calibrate;
  options.on_stage = [&progress](absl::string_view stage) {
    progress.reset();
    progress.emplace(std::string(stage));
  };
  return CompareOutcome(pre.problem, pre.contents, post, options);
}

absl::Status WriteFiles(const Outcome& outcome, const HeadFrame& frame, bool pictures,
                        const std::string& folder) {
  std::vector<std::string> drawn;
  if (pictures) {
    const StageProgress progress("drawing");
    const std::string in = folder + "/pictures";
    std::error_code error;
    std::filesystem::create_directory(in, error);
    TF_ASSIGN_OR_RETURN(drawn, DrawOutcome(outcome, frame, in));
  }
  const nlohmann::ordered_json json = OutcomeJson(outcome, frame);
  TF_RETURN_IF_ERROR(WriteFileAtomically(folder + "/outcome.json", json.dump(2) + "\n"));
  return WriteFileAtomically(folder + "/outcome.html", OutcomeHtml(json, drawn));
}

void PrintSummary(const Outcome& outcome, const std::string& out) {
  absl::PrintF("registered by the %s: %.2f mm RMS for %.0f %% of it\n",
               outcome.by_bone ? "skull" : "forehead", outcome.registration.rms_mm,
               100 * outcome.registration.share);
  for (const SegmentMovement& segment : outcome.segments) {
    if (!segment.measured) continue;
    absl::PrintF("%-10s  misses its plan by %.2f mm left, %.2f forward, %.2f up (fit %.2f mm)\n",
                 segment.handle, segment.deviation_mm[0], -segment.deviation_mm[1],
                 segment.deviation_mm[2], segment.rms_mm);
  }
  for (const ComparedPrediction& prediction : outcome.predictions) {
    if (prediction.regions.empty()) continue;
    const DistanceStatistics& face = prediction.regions.back().predicted_to_real;
    absl::PrintF("%-15s %-8s  mean %.2f mm, median %.2f, 90 %% below %.2f, over 2 mm %.0f %%\n",
                 prediction.model, prediction.movement, face.mean_absolute_mm, face.p50_mm,
                 face.p90_mm, 100 * face.share_over_2mm);
  }
  for (const std::string& caution : outcome.cautions) absl::PrintF("mind  %s\n", caution);
  absl::PrintF("report: %s/outcome.html\n", out);
}

absl::Status RunOutcome(OutcomeArguments arguments) {
  TF_RETURN_IF_ERROR(CheckArguments(arguments));
  SetBlasThreads(1);
  if (arguments.post.threads == 0) arguments.post.threads = AvailableProcessors();
  std::unique_ptr<VirtualDisplay> display;
  if (!arguments.no_pictures) {
    // First, so that a missing program is reported before the work.
    TF_ASSIGN_OR_RETURN(display, VirtualDisplay::Open());
  }
  TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(arguments.out));
  TF_ASSIGN_OR_RETURN(const PreOperativePlan pre, ReadPreOperative(arguments.pre));
  TF_ASSIGN_OR_RETURN(const Outcome outcome, Compare(arguments, pre));
  TF_RETURN_IF_ERROR(
      WriteFiles(outcome, pre.contents.head_frame, !arguments.no_pictures, folder.path()));
  TF_RETURN_IF_ERROR(folder.Publish());
  PrintSummary(outcome, arguments.out);
  return absl::OkStatus();
}

constexpr char kFooter[] =
    "The scans are registered by what was not operated (skull; forehead of a photograph). The "
    "models\npredict from the real movement of each segment and from the planned one. DIR gets "
    "outcome.html,\noutcome.json and pictures/; see docs/outcome.md. They show a face: treat them "
    "like the CT.\nResearch use. Not a medical device.\n\n"
    "Examples:\n"
    "  tissueform outcome --pre head/plan.json --post after/ --out outcome\n"
    "  tissueform outcome --pre head.tfcase --post photo.obj --post-axes RAS --out outcome\n"
    "  tissueform outcome --pre head/plan.json --post skin.stl --post-bone bone.stl --out outcome\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

void AddPostOptions(CLI::App* command, OutcomeArguments* arguments) {
  command
      ->add_option("--post", arguments->post.scan,
                   "after the operation: a CT (as for plan build), or a surface of the skin (.stl "
                   ".ply .obj .off .vtp, mm)")
      ->required();
  command->add_option("--post-bone", arguments->post.bone,
                      "with a surface as --post: the surface of all bone; without it the plan's "
                      "movement is used");
  command
      ->add_option("--post-axes", arguments->post.axes,
                   "of surfaces: where their axes grow toward, three letters of L R A P S I")
      ->capture_default_str();
  command->add_option("--post-labels", arguments->post.labels,
                      "label map of the post-operative CT (as for plan build)");
  command->add_option("--post-recipe", arguments->post.recipe,
                      "a recipe with the keys \"ct\", \"metal\" and \"segmentation\" for the "
                      "post-operative CT");
}

}  // namespace

void AddOutcomeCommand(CLI::App& app, CommandWork* work) {
  auto arguments = std::make_shared<OutcomeArguments>();
  arguments->post.threads = 0;
  CLI::App* command = app.add_subcommand(kOutcomeCommand.name, kOutcomeCommand.description);
  command
      ->add_option("--pre", arguments->pre,
                   "before the operation: plan.json of plan build, or a case (.tfcase)")
      ->required();
  AddPostOptions(command, arguments.get());
  command->add_option("--out", arguments->out, "folder for the report: a new or an empty one")
      ->required();
  command->add_option("--model", arguments->models, "only these models (default: all)")
      ->check(CLI::IsMember(KnownModelNames()));
  command
      ->add_option("--threads", arguments->post.threads,
                   "threads (default 0: one per processor); does not affect the result")
      ->check(CLI::Range(0, 1024));
  command->add_flag("--accept-findings", arguments->accept_findings,
                    "compare in spite of an open mouth or swelling; the report states it");
  command->add_flag("--calibrate", arguments->calibrate,
                    "predict with other settings of linear_elastic, too: how much tissues differ, "
                    "vestibule, seal; a cohort is calibrated by them");
  command->add_flag("--no-pictures", arguments->no_pictures,
                    "report without pictures: needs no display and no Xvfb");
  command->footer(kFooter);
  CLI::App* cohort = AddCohortCommand(command, work);
  // Required options of one patient are not those of a cohort.
  cohort->preparse_callback([command](size_t) {
    for (const char* option : {"--pre", "--post", "--out"}) {
      command->get_option(option)->required(false);
    }
  });
  command->callback([arguments, command, cohort, work] {
    if (command->got_subcommand(cohort)) return;
    *work = [arguments] { return RunOutcome(*arguments); };
  });
}

}  // namespace tissueform
