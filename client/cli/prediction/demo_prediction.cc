// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/demo_prediction.h"

#include <utility>

#include "absl/strings/str_format.h"

#include "client/cli/session/handle_words.h"
#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"
#include "core/planning/model_names.h"
#include "proto/conversion/prediction_conversion.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

DeformationModel OtherModel(DeformationModel model) {
  return model == DeformationModel::kLinearElastic ? DeformationModel::kGradientField
                                                   : DeformationModel::kLinearElastic;
}

absl::StatusOr<std::vector<RegionDistances>> Differences(const PlanProblem& problem,
                                                         const std::vector<ComparedRegion>& face,
                                                         const DemoPrediction& prediction,
                                                         const v1::DeformOnceResponse& answer) {
  TF_ASSIGN_OR_RETURN(const Positions other,
                      DecodePositions(answer.positions(), problem.mesh->num_vertices()));
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd distances, VertexDistances(prediction.deformed, other));
  std::vector<ComparedRegion> regions = {{"free skin", FreeSkin(problem)}, {"face", {}}};
  for (const ComparedRegion& part : face) {
    std::vector<int32_t>& whole = regions.back().vertices;
    whole.insert(whole.end(), part.vertices.begin(), part.vertices.end());
  }
  regions.insert(regions.end(), face.begin(), face.end());
  return DistancesByRegion(distances, regions);
}

// The slow model that iterates, at the end, where there is time for it.
absl::Status KeepAndRefine(const PlanProblem& problem, TissueformClient* client,
                           const std::string& session, DemoPrediction* prediction) {
  const std::vector<NamedPose> poses = NamedPoses(problem);
  PredictionCalls& calls = client->predictions();
  TF_ASSIGN_OR_RETURN(const v1::Prediction kept, calls.Create(session, poses));
  prediction->kept = kept.name();
  if (kept.model() == v1::DEFORMATION_MODEL_NEO_HOOKEAN) return absl::OkStatus();
  const auto refined = calls.Create(session, poses, v1::DEFORMATION_MODEL_NEO_HOOKEAN);
  prediction->refined_answer = refined.status();
  if (!refined.ok()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const ComparedPredictions compared,
                      calls.Compare(kept.name(), refined->name()));
  prediction->refined = refined->name();
  prediction->refinement = ToDistanceSummary(compared.comparison.distances());
  return absl::OkStatus();
}

OrderedJson MovementToJson(const Movement& movement) {
  return {{"total_mm", movement.total_mm}, {"forward_mm", movement.forward_mm}};
}

}  // namespace

absl::StatusOr<DemoPrediction> PredictAtEnd(const PlanProblem& problem,
                                            const std::vector<ComparedRegion>& face,
                                            TissueformClient* client, const std::string& session) {
  DemoPrediction prediction;
  const std::vector<NamedPose> poses = NamedPoses(problem);
  TF_ASSIGN_OR_RETURN(const v1::DeformOnceResponse answer, client->DeformOnce(session, poses));
  TF_ASSIGN_OR_RETURN(prediction.deformed,
                      DecodePositions(answer.positions(), problem.mesh->num_vertices()));
  prediction.move = MovesInWords(problem);
  prediction.model = ModelName(problem.deformer.model);
  prediction.tets = problem.mesh->num_tets();
  prediction.inverted_tets = answer.quality().inverted_tet_count();
  prediction.movement = MeasureMovement(face, problem.mesh->positions(), prediction.deformed);

  const DeformationModel other = OtherModel(problem.deformer.model);
  prediction.other_model = ModelName(other);
  const auto other_answer = client->DeformOnce(session, poses, {}, ToProto(other));
  prediction.other_answer = other_answer.status();
  if (other_answer.ok()) {
    TF_ASSIGN_OR_RETURN(prediction.differences,
                        Differences(problem, face, prediction, *other_answer));
  }
  TF_RETURN_IF_ERROR(KeepAndRefine(problem, client, session, &prediction));
  return prediction;
}

void AddToJson(const DemoPrediction& prediction, OrderedJson* json) {
  (*json)["move"] = prediction.move;
  (*json)["model"] = prediction.model;
  (*json)["inverted_tets"] = prediction.inverted_tets;
  OrderedJson& movement = (*json)["movement"] = OrderedJson::object();
  for (const RegionMovement& region : prediction.movement) {
    movement[region.name] = {{"vertices", region.vertices},
                             {"foremost", MovementToJson(region.foremost)},
                             {"mean", MovementToJson(region.mean)}};
  }
  OrderedJson& difference = (*json)["difference"] = {{"model", prediction.other_model},
                                                     {"regions", OrderedJson::object()}};
  for (const auto& [name, distances] : prediction.differences) {
    difference["regions"][name] = DistancesToJson(distances);
  }
  (*json)["prediction"] = prediction.kept;
  if (!prediction.refined.empty()) {
    (*json)["refinement"] = {{"prediction", prediction.refined},
                             {"model", "neo_hookean"},
                             {"distances", DistancesToJson(prediction.refinement)}};
  }
}

void PrintKept(const DemoPrediction& prediction) {
  absl::PrintF("\nstored by the server: %s (%s)\n", prediction.kept, prediction.model);
  if (!prediction.refined.empty()) {
    absl::PrintF(
        "refined by neo_hookean: %s; it differs by %.2f mm on average and %.2f mm at most\n",
        prediction.refined, prediction.refinement.mean_mm, prediction.refinement.max_mm);
  } else if (!prediction.refined_answer.ok()) {
    absl::PrintF("not refined by neo_hookean: %s\n", prediction.refined_answer.message());
  }
}

void PrintPrediction(const DemoPrediction& prediction) {
  if (!prediction.movement.empty()) {
    absl::PrintF("\nthe skin after \"%s\" by %s, in mm\n", prediction.move, prediction.model);
    absl::PrintF("%-16s %14s %14s %14s %14s\n", "region", "largest", "forward", "mean", "forward");
  }
  for (const RegionMovement& region : prediction.movement) {
    absl::PrintF("%-16s %14.2f %14.2f %14.2f %14.2f\n", region.name, region.foremost.total_mm,
                 region.foremost.forward_mm, region.mean.total_mm, region.mean.forward_mm);
  }
  if (!prediction.other_answer.ok()) {
    absl::PrintF("\nno comparison with %s: %s\n", prediction.other_model,
                 prediction.other_answer.message());
    return;
  }
  absl::PrintF("\ndifference between %s and %s there, in mm\n", prediction.model,
               prediction.other_model);
  absl::PrintF("%-16s %14s %14s %14s\n", "region", "mean", "p95", "max");
  for (const auto& [name, distances] : prediction.differences) {
    absl::PrintF("%-16s %14.2f %14.2f %14.2f\n", name, distances.mean_mm, distances.p95_mm,
                 distances.max_mm);
  }
}

}  // namespace tissueform
