// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/json_values.h"

#include <numbers>

#include "nlohmann/json.hpp"

namespace tissueform {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

Eigen::Vector3d VectorOrZero(const nlohmann::json& json, const char* key) {
  return json.contains(key) ? VectorFromJson(json.at(key)) : Eigen::Vector3d::Zero();
}

}  // namespace

Eigen::Vector3d VectorFromJson(const nlohmann::json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

nlohmann::json ToJson(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

HandlePose PoseFromJson(const nlohmann::json& json) {
  HandlePose pose;
  pose.rotation_vector = VectorOrZero(json, "rotation_vector_deg") * kRadiansPerDegree;
  pose.pivot_mm = VectorOrZero(json, "pivot_mm");
  pose.translation_mm = VectorOrZero(json, "translation_mm");
  pose.scale = json.value("scale", 1.0);
  return pose;
}

nlohmann::json ToJson(const HandlePose& pose) {
  return {
      {"rotation_vector_deg", ToJson(Eigen::Vector3d(pose.rotation_vector / kRadiansPerDegree))},
      {"pivot_mm", ToJson(pose.pivot_mm)},
      {"translation_mm", ToJson(pose.translation_mm)},
      {"scale", pose.scale}};
}

VertexSelector SelectorFromJson(const nlohmann::json& json) {
  if (json.contains("vertices")) {
    return {SelectVertices{json.at("vertices").get<std::vector<int64_t>>()}};
  }
  if (json.contains("point_data")) {
    return {SelectByPointData{json.at("point_data"), json.at("equals")}};
  }
  if (json.contains("box_mm")) {
    const nlohmann::json& box = json.at("box_mm");
    return {SelectBox{VectorFromJson(box.at("min")), VectorFromJson(box.at("max"))}};
  }
  SelectUnion parts;
  for (const nlohmann::json& part : json.at("union")) parts.of.push_back(SelectorFromJson(part));
  return {std::move(parts)};
}

}  // namespace tissueform
