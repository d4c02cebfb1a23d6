// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/material_band.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>

#include "absl/cleanup/cleanup.h"

#include "client/cpp/prepared_evaluator.h"
#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/pose_range.h"
#include "proto/conversion/geometry_conversion.h"
#include "server/platform/storage/durable_file.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {
namespace {

bool DependsOnMaterial(v1::DeformationModel model) {
  return model == v1::DEFORMATION_MODEL_LINEAR_ELASTIC ||
         model == v1::DEFORMATION_MODEL_NEO_HOOKEAN;
}

bool IsOfTheCase(const v1::Prediction& prediction, const v1::CreateSessionRequest& request) {
  return prediction.mesh() == request.mesh() &&
         prediction.stiffness().SerializeAsString() == request.stiffness().SerializeAsString();
}

}  // namespace

absl::StatusOr<std::vector<double>> AskMaterialBand(TissueformClient* client,
                                                    const CaseFile& contents,
                                                    const v1::Prediction& prediction) {
  if (!WhyNoMaterialBand(contents, prediction).empty()) return std::vector<double>();
  v1::PrepareSessionRequest request;
  v1::PreparedAnswers prepared;
  if (!request.mutable_create()->ParseFromString(contents.session_request) ||
      !prepared.mutable_ranges()->ParseFromString(*contents.material_ranges)) {
    return absl::DataLossError("the case's session request or ranges of the material are damaged");
  }
  // Linear elasticity gives the band of either model, and its columns are the cheaper ones.
  request.mutable_create()->set_model(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  TF_ASSIGN_OR_RETURN(const v1::Session session, client->PrepareSession(request, {}));
  const auto end = absl::MakeCleanup(
      [client, &session] { client->DeleteSession(session.name()).IgnoreError(); });
  DeformStream::Options options;
  options.prepared = prepared;
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<PreparedEvaluator> evaluator,
                      client->FetchPreparedAnswers(session, options));
  std::vector<NamedPose> poses;
  poses.reserve(static_cast<size_t>(prediction.poses_size()));
  for (const v1::HandlePose& pose : prediction.poses()) poses.push_back(ToNamedPose(pose));
  TF_ASSIGN_OR_RETURN(const std::optional<EvaluatedAnswer> answer, evaluator->Evaluate(poses));
  if (!answer) return std::vector<double>();
  return std::vector<double>(answer->band_mm.begin(), answer->band_mm.end());
}

std::string WhyNoMaterialBand(const CaseFile& contents, const v1::Prediction& prediction) {
  if (!contents.material_ranges) return "the case has no ranges of the material";
  if (!DependsOnMaterial(prediction.model())) {
    return "only predictions of linear_elastic and neo_hookean have a band of uncertainty";
  }
  v1::CreateSessionRequest request;
  if (!request.ParseFromString(contents.session_request)) return "";
  if (!IsOfTheCase(prediction, request)) {
    return "its mesh or stiffness differs from the case's";
  }
  const auto turns_too_far = [](const v1::HandlePose& pose) {
    const double turn_rad = ToNamedPose(pose).pose.rotation_vector.norm();
    return !HasBand(turn_rad, kLargestBandRotationRad);
  };
  if (std::any_of(prediction.poses().begin(), prediction.poses().end(), turns_too_far)) {
    return "a segment turns by more than 30 degrees, which linear elasticity treats as strain";
  }
  return "";
}

std::optional<std::vector<double>> ReadBandFile(const std::string& path, Eigen::Index vertices) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  const std::string kept{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::vector<double> band(kept.size() / sizeof(double));
  if (!band.empty()) std::memcpy(band.data(), kept.data(), band.size() * sizeof(double));
  if (!band.empty() && band.size() != static_cast<size_t>(vertices)) return std::nullopt;
  return band;
}

absl::Status WriteBandFile(const std::string& path, const std::vector<double>& band_mm) {
  return WriteDurably(path, {absl::string_view(reinterpret_cast<const char*>(band_mm.data()),
                                               band_mm.size() * sizeof(double))});
}

}  // namespace tissueform
