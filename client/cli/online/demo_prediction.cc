// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/demo_prediction.h"

#include <utility>

#include "absl/strings/str_format.h"

#include "client/cli/online/handle_words.h"
#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"
#include "core/planning/model_names.h"

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
}

void PrintPrediction(const DemoPrediction& prediction) {
  if (!prediction.movement.empty()) {
    absl::PrintF("\nthe skin after \"%s\" by %s, in mm\n", prediction.move, prediction.model);
    absl::PrintF("%-16s %14s %14s %14s %14s\n", "region", "foremost point", "of it forward",
                 "mean of region", "of it forward");
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
