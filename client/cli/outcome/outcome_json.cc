// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/outcome_json.h"

#include <cmath>

#include "core/base/software_version.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

Json StatisticsJson(const DistanceStatistics& found) {
  return {{"area_cm2", Rounded(found.area_cm2)},
          {"mean_mm", Rounded(found.mean_mm)},
          {"mean_absolute_mm", Rounded(found.mean_absolute_mm)},
          {"p50_mm", Rounded(found.p50_mm)},
          {"p90_mm", Rounded(found.p90_mm)},
          {"p95_mm", Rounded(found.p95_mm)},
          {"max_mm", Rounded(found.max_mm)},
          {"share_over_1mm", Rounded(found.share_over_1mm)},
          {"share_over_2mm", Rounded(found.share_over_2mm)}};
}

Json RegionsJson(const std::vector<RegionComparison>& regions) {
  Json list = Json::array();
  for (const RegionComparison& region : regions) {
    list.push_back({{"region", region.region},
                    {"compared_share", Rounded(region.compared_share)},
                    {"predicted_to_real", StatisticsJson(region.predicted_to_real)},
                    {"real_to_predicted", StatisticsJson(region.real_to_predicted)}});
  }
  return list;
}

Json LandmarksJson(const std::vector<LandmarkComparison>& landmarks) {
  Json list = Json::array();
  for (const LandmarkComparison& landmark : landmarks) {
    list.push_back({{"landmark", landmark.name},
                    {"predicted_forward_mm", Rounded(landmark.predicted_forward_mm)},
                    {"predicted_up_mm", Rounded(landmark.predicted_up_mm)},
                    {"real_forward_mm", Rounded(landmark.real_forward_mm)},
                    {"real_up_mm", Rounded(landmark.real_up_mm)},
                    {"error_mm", Rounded(landmark.error_mm)}});
  }
  return list;
}

Json WayJson(const Eigen::Vector3d& in_frame) {
  return {{"left_mm", Rounded(in_frame[0])},
          {"forward_mm", Rounded(-in_frame[1])},
          {"up_mm", Rounded(in_frame[2])}};
}

Json AnglesJson(const HeadAngles& angles) {
  return {{"pitch_deg", Rounded(angles.pitch_deg)},
          {"roll_deg", Rounded(angles.roll_deg)},
          {"yaw_deg", Rounded(angles.yaw_deg)}};
}

// At the pivot of the case's handle.
Json PoseJson(const HandlePose& pose, const HeadFrame& frame) {
  Json json = WayJson(frame.ToLps().transpose() * pose.translation_mm);
  json.update(AnglesJson(AnglesFromRotationVector(pose.rotation_vector, frame)));
  return json;
}

Json SegmentsJson(const Outcome& outcome, const HeadFrame& frame) {
  Json list = Json::array();
  for (const SegmentMovement& segment : outcome.segments) {
    Json json = {{"segment", segment.handle},
                 {"measured", segment.measured},
                 {"planned", PoseJson(segment.planned, frame)}};
    if (segment.measured) {
      Json deviation = WayJson(segment.deviation_mm);
      deviation.update(AnglesJson(segment.deviation_deg));
      json["real"] = PoseJson(segment.real, frame);
      json["deviation"] = deviation;
      json["rms_mm"] = Rounded(segment.rms_mm);
      json["share_used"] = Rounded(segment.share);
    }
    list.push_back(json);
  }
  return list;
}

Json PredictionsJson(const Outcome& outcome) {
  Json list = Json::array();
  for (const ComparedPrediction& prediction : outcome.predictions) {
    list.push_back({{"model", prediction.model},
                    {"movement", prediction.movement},
                    {"load", Rounded(prediction.load)},
                    {"regions", RegionsJson(prediction.regions)},
                    {"landmarks", LandmarksJson(prediction.landmarks)}});
  }
  return list;
}

Json BySettingsJson(const Outcome& outcome) {
  Json list = Json::array();
  for (const SettingsComparison& comparison : outcome.by_settings) {
    Json regions = Json::array();
    for (const RegionComparison& region : comparison.regions) {
      regions.push_back({{"region", region.region},
                         {"mean_absolute_mm", Rounded(region.predicted_to_real.mean_absolute_mm)}});
    }
    const ModelSettings& settings = comparison.settings;
    list.push_back(
        {{"settings",
          {{"stiffness_contrast", settings.stiffness_contrast},
           {"vestibule_mm", settings.vestibule_mm ? Json(*settings.vestibule_mm) : Json(nullptr)},
           {"seal", settings.seal}}},
         {"movement", outcome.predictions.front().movement},
         {"regions", regions}});
  }
  return list;
}

}  // namespace

double Rounded(double value) { return std::round(value * 1000) / 1000; }

Json OutcomeJson(const Outcome& outcome, const HeadFrame& frame) {
  const RigidMove& move = outcome.registration.to_pre;
  Json json = {{"format", "tissueform-outcome"},
               {"version", 1},
               {"notice", "research software, not a medical device"},
               {"software", std::string("tissueform ") + std::string(SoftwareVersion())},
               {"head_frame", frame.source},
               {"registration",
                {{"by", outcome.by_bone ? "skull" : "forehead"},
                 {"rms_mm", Rounded(outcome.registration.rms_mm)},
                 {"share_used", Rounded(outcome.registration.share)},
                 {"turned_deg", Rounded(TurnDegrees(move))}}},
               {"segments", SegmentsJson(outcome, frame)}};
  json["mouth_opening_deg"] =
      outcome.opening ? Json(Rounded(outcome.opening->degrees)) : Json(nullptr);
  json["predictions"] = PredictionsJson(outcome);
  json["by_settings"] = BySettingsJson(outcome);
  json["by_published_ratios"] = LandmarksJson(outcome.by_ratios);
  json["excess_ml"] = Rounded(outcome.excess_ml);
  json["cautions"] = outcome.cautions;
  return json;
}

}  // namespace tissueform
