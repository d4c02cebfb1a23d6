// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/exported_face.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mechanics/uncertainty/band_columns.h"
#include "core/planning/model_names.h"

namespace tissueform {
namespace {

absl::StatusOr<DeformationModel> ChosenModel(const PlanProblem& problem, const std::string& name) {
  DeformationModel model = problem.deformer.model;
  if (!name.empty()) {
    TF_ASSIGN_OR_RETURN(model, ModelFromName(name));
  }
  if (HasPreparedAnswers(model, problem.deformer.gradient_field, problem.constraints)) return model;
  return absl::InvalidArgumentError(absl::StrCat(
      "the model ", ModelName(model),
      ", with the plan's settings, has no prepared answers, which a moving file needs; choose one "
      "with --model: ",
      ModelsWithPreparedAnswers(problem.constraints)));
}

absl::StatusOr<std::vector<bool>> FreeHandles(const std::vector<CaseHandle>& handles,
                                              const std::vector<std::string>& segments) {
  std::vector<bool> is_free(handles.size(), segments.empty());
  for (const std::string& segment : segments) {
    const auto found = std::find_if(handles.begin(), handles.end(),
                                    [&](const CaseHandle& h) { return h.name == segment; });
    if (found == handles.end()) {
      const auto add_name = [](std::string* text, const CaseHandle& h) { *text += h.name; };
      return absl::InvalidArgumentError(absl::StrCat("--segments: the plan has no handle \"",
                                                     segment, "\"; it has ",
                                                     absl::StrJoin(handles, ", ", add_name)));
    }
    is_free[static_cast<size_t>(found - handles.begin())] = true;
  }
  return is_free;
}

absl::StatusOr<PortableAnswers> PrepareAnswers(const PlanProblem& problem, DeformationModel model,
                                               const std::vector<int32_t>& vertices) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<MeshPreparation> preparation,
                      MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints,
                                              problem.deformer.preparation));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<VertexResponse> response,
                      CreateResponse(preparation, vertices, {.model = model}));
  PortableAnswers answers = response->Describe();
  // The band is not known with contact.
  if (problem.uncertainty && TraitsOf(model).is_elastic && problem.constraints.contact().empty()) {
    TF_ASSIGN_OR_RETURN(const std::unique_ptr<BandColumns> band,
                        BandColumns::Create(preparation, *problem.uncertainty, vertices, nullptr));
    band->Describe(&answers);
  }
  return answers;
}

std::vector<AnswerPose> PosesOf(const std::vector<CaseHandle>& handles) {
  std::vector<AnswerPose> poses;
  for (const CaseHandle& handle : handles) {
    AnswerPose& pose = poses.emplace_back();
    std::copy_n(handle.pose.rotation_vector.data(), 3, pose.rotation_vector.begin());
    std::copy_n(handle.pose.pivot_mm.data(), 3, pose.pivot_mm.begin());
    std::copy_n(handle.pose.translation_mm.data(), 3, pose.translation_mm.begin());
    pose.scale = handle.pose.scale;
  }
  return poses;
}

absl::Status BeyondAnswers(DeformationModel model) {
  const bool is_linear = model == DeformationModel::kLinearElastic;
  return absl::FailedPreconditionError(absl::StrCat(
      "the plan moves bone beyond the range of the prepared answers of ", ModelName(model),
      ", so the file could not show it; choose ",
      ModelName(is_linear ? DeformationModel::kGradientField : DeformationModel::kLinearElastic),
      " with --model, or smaller moves in the plan"));
}

}  // namespace

absl::StatusOr<MovingData> ExportFace(OpenedPlan opened, const ExportedFaceOptions& options) {
  const PlanProblem& problem = opened.problem;
  CaseFile contents = std::move(opened.contents);
  TF_ASSIGN_OR_RETURN(const DeformationModel model, ChosenModel(problem, options.model));
  MovingData data;
  TF_ASSIGN_OR_RETURN(data.handle_is_free, FreeHandles(contents.handles, options.segments));
  data.title = options.title;
  data.software = absl::StrCat("tissueform ", SoftwareVersion());
  data.model = ModelName(model);
  data.head_frame = contents.head_frame;
  data.handles = std::move(contents.handles);
  data.surfaces = std::move(contents.surfaces);
  const std::vector<int32_t> vertices = FollowedVerticesOf(&data.surfaces);
  TF_ASSIGN_OR_RETURN(PortableAnswers answers, PrepareAnswers(problem, model, vertices));
  const AnswerEvaluator evaluator(std::move(answers));
  if (!evaluator.Covers(PosesOf(data.handles))) return BeyondAnswers(model);
  data.answers = WriteAnswers(evaluator.answers());
  return data;
}

}  // namespace tissueform
