// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/values_report.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/planning/plan_report/histogram.h"
#include "core/planning/rendering/palette.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMouthHalfWidthMm = 28;
constexpr double kLeastPercent = 0.01;  // on the logarithmic axis

// How far the face is in the field of view, from the midsagittal plane.
struct SharedFace {
  std::optional<double> left_mm;
  std::optional<double> right_mm;
};

// The nearest cuts beside the mouth, in the region of interest and in front of the angles of the
// jaw: farther back the nape is cut, and what is cut in the middle is named by CutCautions.
SharedFace MeasureSharedFace(const PlanBuild& build) {
  SharedFace face;
  if (!build.values.field || build.head.cut.values.empty()) return face;
  const Landmarks& landmarks = build.landmarks;
  const double back_mm = std::min(landmarks.gonion.left.y(), landmarks.gonion.right.y());
  const std::vector<Plane> planes = build.soft_tissue.region.planes();
  ForEachVoxel(build.head.cut, [&](size_t /*index*/, const Eigen::Vector3d& place) {
    if (place.y() > back_mm || LeastHeightMm(planes, place) < 0) return;
    const double left_mm = landmarks.midsagittal.HeightMm(place);
    if (std::abs(left_mm) < kMouthHalfWidthMm) return;
    std::optional<double>& side = left_mm > 0 ? face.left_mm : face.right_mm;
    side = std::min(side.value_or(std::abs(left_mm)), std::abs(left_mm));
  });
  return face;
}

Json FieldJson(const PlanBuild& build) {
  const std::optional<CylinderField>& field = build.values.field;
  if (!field) return nullptr;
  Json json = {{"shape", "cylinder"},
               {"diameter_mm", 2 * field->radius_mm},
               {"value_outside", field->outside_value}};
  const SharedFace face = MeasureSharedFace(build);
  if (face.left_mm) json["face_predicted_to_left_mm"] = *face.left_mm;
  if (face.right_mm) json["face_predicted_to_right_mm"] = *face.right_mm;
  return json;
}

std::string FieldCaution(const PlanBuild& build) {
  const SharedFace face = MeasureSharedFace(build);
  std::vector<std::string> sides;
  if (face.left_mm) sides.push_back(absl::StrFormat("%.0f mm on the left", *face.left_mm));
  if (face.right_mm) sides.push_back(absl::StrFormat("%.0f mm on the right", *face.right_mm));
  if (sides.empty()) return "";
  return absl::StrFormat(
      "The field of view is a cylinder %.0f mm wide and does not hold the whole face. The face is "
      "not "
      "predicted farther from the midsagittal plane than %s. The model ends there at a cut that is "
      "free to move.",
      2 * build.values.field->radius_mm, absl::StrJoin(sides, " and "));
}

Curve ThresholdCurve(const std::string& name, double gray, const Curve& histogram,
                     CurveStyle style) {
  const auto [low, high] = std::minmax_element(histogram.y.begin(), histogram.y.end());
  return {.name = name, .x = {gray, gray}, .y = {*low, *high}, .colour = kOrange, .style = style};
}

}  // namespace

Json ValuesJson(const PlanBuild& build) {
  if (!build.surface_roles.empty()) return {{"are", "made from the distances to the surfaces"}};
  const CtValuesReport& values = build.values;
  Json json = {{"are", values.gray ? "gray" : "hu"}, {"reason", values.reason}};
  if (values.gray) {
    json["gray_levels"] = {{"air", values.levels.air},
                           {"soft_tissue", values.levels.soft},
                           {"bone", values.levels.hard},
                           {"tissue_above", values.levels.tissue_above},
                           {"bone_above", values.levels.bone_above}};
    json["on_scale_of_hu"] = {{"tissue_above", values.tissue_above_hu},
                              {"bone_above", values.bone_above_hu}};
    json["stiffness"] = "of one tissue, but where labels name muscle or fat";
  }
  json["field_of_view"] = FieldJson(build);
  return json;
}

std::vector<std::string> ValuesCautions(const PlanBuild& build) {
  std::vector<std::string> cautions;
  if (build.values.gray) {
    cautions.push_back(absl::StrCat(
        "This CT has gray values, not HU. ", build.values.reason,
        " Thresholds come from its histogram (picture): check the picture of the bone, and set "
        "\"tissue_above_gray\" or \"bone_above_gray\" in the recipe's \"ct\" where they are wrong. "
        "Stiffness does not come from gray values: all soft tissue that labels do not name has one "
        "modulus."));
  }
  std::string field = FieldCaution(build);
  if (!field.empty()) cautions.push_back(std::move(field));
  return cautions;
}

Chart GrayHistogramChart(const PlanBuild& build) {
  const CtValuesReport& values = build.values;
  const Curve curve = HistogramCurve({.low = values.histogram.low,
                                      .bin_width = values.histogram.bin_width,
                                      .counts = values.histogram.counts},
                                     "voxels in the field of view", kBlue, kLeastPercent);
  return {
      .title = "Gray values",
      .x_title = "gray value of the file",
      .y_title = "voxels [%]",
      .logarithmic_y = true,
      .curves = {
          curve,
          ThresholdCurve("tissue above", values.levels.tissue_above, curve, CurveStyle::kDashed),
          ThresholdCurve("bone above", values.levels.bone_above, curve, CurveStyle::kDotted)}};
}

}  // namespace tissueform
