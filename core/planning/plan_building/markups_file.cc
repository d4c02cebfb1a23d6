// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/markups_file.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/base/json/json_file.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxMarkupsBytes = size_t{4} << 20;
constexpr double kLargestCoordinateMm = 1e6;
// Points on one line leave a plane free to turn about it.
constexpr double kLeastSpread = 1e-4;

absl::StatusOr<Eigen::Vector3d> ToVector(const Json& json) {
  if (!json.is_array() || json.size() != 3) {
    return absl::InvalidArgumentError("a position is not a list of three numbers");
  }
  Eigen::Vector3d vector;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Json& number = json[static_cast<size_t>(i)];
    if (!number.is_number() || !(std::abs(number.get<double>()) <= kLargestCoordinateMm)) {
      return absl::InvalidArgumentError("a coordinate is not a number within 1e6 mm");
    }
    vector[i] = number.get<double>();
  }
  return vector;
}

std::string TextOf(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

// How coordinates of an entry become LPS in mm.
struct Axes {
  Eigen::Vector3d factors = Eigen::Vector3d::Ones();
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
};

absl::StatusOr<Axes> AxesOf(const Json& markup) {
  Axes axes;
  const std::string system = TextOf(markup, "coordinateSystem");
  if (system == "RAS") axes.signs = {-1, -1, 1};
  if (markup.contains("coordinateSystem") && system != "RAS" && system != "LPS") {
    return absl::InvalidArgumentError(
        "\"coordinateSystem\" is neither \"LPS\" nor \"RAS\"; save the markups again in 3D Slicer");
  }
  std::string unit = TextOf(markup, "coordinateUnits");
  const auto units = markup.find("coordinateUnits");
  if (units != markup.end() && units->is_array() && !units->empty() && units->front().is_string()) {
    unit = units->front().get<std::string>();
  }
  if (units != markup.end() && unit != "mm" && unit != "um") {
    return absl::InvalidArgumentError("\"coordinateUnits\" is neither \"mm\" nor \"um\"");
  }
  axes.factors = axes.signs * (unit == "um" ? 1e-3 : 1);
  return axes;
}

absl::StatusOr<std::vector<MarkupPoint>> PointsOf(const Json& markup, const Axes& axes) {
  std::vector<MarkupPoint> points;
  const auto list = markup.find("controlPoints");
  if (list == markup.end()) return points;
  if (!list->is_array()) return absl::InvalidArgumentError("\"controlPoints\" is not a list");
  for (const Json& json : *list) {
    if (!json.is_object()) return absl::InvalidArgumentError("a control point is not an object");
    const std::string status = TextOf(json, "positionStatus");
    if (!status.empty() && status != "defined") continue;
    if (!json.contains("position")) continue;
    TF_ASSIGN_OR_RETURN(const Eigen::Vector3d position, ToVector(json.at("position")));
    points.push_back({TextOf(json, "label"), axes.factors.cwiseProduct(position)});
  }
  return points;
}

// Through the points; its normal is that of the first three, seen counter-clockwise.
std::optional<Plane> PlaneThrough(const std::vector<MarkupPoint>& points) {
  if (points.size() < 3) return std::nullopt;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const MarkupPoint& point : points) {
    middle += point.position_mm / static_cast<double>(points.size());
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const MarkupPoint& point : points) {
    spread += (point.position_mm - middle) * (point.position_mm - middle).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  if (!(axes.eigenvalues()[1] > kLeastSpread * axes.eigenvalues()[2])) return std::nullopt;
  Eigen::Vector3d normal = axes.eigenvectors().col(0);
  const Eigen::Vector3d turn = (points[1].position_mm - points[0].position_mm)
                                   .cross(points[2].position_mm - points[0].position_mm);
  if (normal.dot(turn) < 0) normal = -normal;
  return Plane{middle, normal};
}

absl::StatusOr<std::optional<Plane>> PlaneOf(const Json& json, const Axes& axes,
                                             const std::vector<MarkupPoint>& points) {
  if (!json.contains("normal")) return PlaneThrough(points);
  TF_ASSIGN_OR_RETURN(Eigen::Vector3d normal, ToVector(json.at("normal")));
  normal = axes.signs.cwiseProduct(normal);
  if (!(normal.norm() > 1e-6)) return absl::InvalidArgumentError("a plane's normal has no length");
  Plane plane{Eigen::Vector3d::Zero(), normal.normalized()};
  if (json.contains("center")) {
    TF_ASSIGN_OR_RETURN(const Eigen::Vector3d center, ToVector(json.at("center")));
    plane.point_mm = axes.factors.cwiseProduct(center);
  } else if (!points.empty()) {
    plane.point_mm = points.front().position_mm;
  } else {
    return absl::InvalidArgumentError("a plane has no center and no control point");
  }
  return plane;
}

absl::StatusOr<Markup> ToMarkup(const Json& json) {
  if (!json.is_object()) return absl::InvalidArgumentError("an entry is not an object");
  TF_ASSIGN_OR_RETURN(const Axes axes, AxesOf(json));
  Markup markup;
  markup.type = TextOf(json, "type");
  markup.name = TextOf(json, "name");
  TF_ASSIGN_OR_RETURN(markup.points, PointsOf(json, axes));
  TF_ASSIGN_OR_RETURN(markup.plane, PlaneOf(json, axes, markup.points));
  return markup;
}

}  // namespace

absl::StatusOr<std::vector<Markup>> ParseMarkups(const std::string& text) {
  TF_ASSIGN_OR_RETURN(const Json json, ParseJsonStrictly(text));
  const auto list = json.is_object() ? json.find("markups") : json.end();
  if (!json.is_object() || list == json.end() || !list->is_array()) {
    return absl::InvalidArgumentError(
        "the file has no list \"markups\": it is not a markups file of 3D Slicer (.mrk.json)");
  }
  if (list->empty()) return absl::InvalidArgumentError("the markups file is empty");
  std::vector<Markup> markups;
  markups.reserve(list->size());
  for (const Json& entry : *list) {
    TF_ASSIGN_OR_RETURN(Markup markup, ToMarkup(entry));
    markups.push_back(std::move(markup));
  }
  return markups;
}

absl::StatusOr<std::vector<Markup>> ReadMarkups(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(path, "markups file", kMaxMarkupsBytes));
  absl::StatusOr<std::vector<Markup>> markups = ParseMarkups(text);
  if (markups.ok()) return markups;
  return absl::Status(markups.status().code(),
                      absl::StrCat("markups file: ", markups.status().message()));
}

}  // namespace tissueform
