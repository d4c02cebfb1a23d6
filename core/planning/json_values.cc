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

}  // namespace tissueform
