// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/handle_pose.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

// Far beyond any head, far below where squares overflow (docs/plan-format.md).
constexpr double kLargestScale = 1e6;
constexpr double kLargestLengthMm = 1e9;
// Far beyond any twist; there sine and cosine still have ten digits.
constexpr double kLargestAngle = 1e6;

absl::Status CheckFinite(const Eigen::Vector3d& vector, absl::string_view field) {
  if (vector.allFinite()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("pose has a NaN or infinite ", field, "; give three finite numbers"));
}

// pow is exact at 0 and 1, so both ends are met to the last bit; equal scales are not left to it.
double ScaleBetween(double a, double b, double t) {
  return a == b ? a : std::pow(a, 1 - t) * std::pow(b, t);
}

}  // namespace

Eigen::Matrix3d RotationMatrix(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle == 0) {
    return Eigen::Matrix3d::Identity();
  }
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

absl::Status CheckPose(const HandlePose& pose) {
  if (auto status = CheckFinite(pose.rotation_vector, "rotation vector"); !status.ok()) {
    return status;
  }
  if (auto status = CheckFinite(pose.pivot_mm, "pivot"); !status.ok()) {
    return status;
  }
  if (auto status = CheckFinite(pose.translation_mm, "translation"); !status.ok()) {
    return status;
  }
  if (const double largest = pose.rotation_vector.cwiseAbs().maxCoeff(); largest > kLargestAngle) {
    return absl::InvalidArgumentError(absl::StrCat("pose has a rotation vector of ", largest,
                                                   " radians; it may be ", kLargestAngle,
                                                   " at most, so that positions stay finite"));
  }
  if (!std::isfinite(pose.scale) || pose.scale <= 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("pose has scale ", pose.scale, "; it must be a positive number"));
  }
  if (pose.scale > kLargestScale) {
    return absl::InvalidArgumentError(absl::StrCat("pose has scale ", pose.scale, "; it may be ",
                                                   kLargestScale,
                                                   " at most, so that positions stay finite"));
  }
  for (const auto& [vector, what] :
       {std::pair(pose.pivot_mm, "pivot"), std::pair(pose.translation_mm, "translation")}) {
    if (const double largest = vector.cwiseAbs().maxCoeff(); largest > kLargestLengthMm) {
      return absl::InvalidArgumentError(absl::StrCat("pose has a ", what, " of ", largest,
                                                     " mm; it may be ", kLargestLengthMm,
                                                     " mm at most, so that positions stay finite"));
    }
  }
  return absl::OkStatus();
}

Eigen::Vector3d ApplyPose(const HandlePose& pose, const Eigen::Vector3d& position) {
  return pose.pivot_mm +
         pose.scale * (RotationMatrix(pose.rotation_vector) * (position - pose.pivot_mm)) +
         pose.translation_mm;
}

HandlePose PoseBetween(const HandlePose& a, const HandlePose& b, double t) {
  return {.rotation_vector = (1 - t) * a.rotation_vector + t * b.rotation_vector,
          .pivot_mm = (1 - t) * a.pivot_mm + t * b.pivot_mm,
          .translation_mm = (1 - t) * a.translation_mm + t * b.translation_mm,
          .scale = ScaleBetween(a.scale, b.scale, t)};
}

HandlePose RestOf(const HandlePose& pose) {
  return {.rotation_vector = Eigen::Vector3d::Zero(),
          .pivot_mm = pose.pivot_mm,
          .translation_mm = Eigen::Vector3d::Zero(),
          .scale = 1};
}

HandlePose PartOfPose(const HandlePose& pose, double amount) {
  HandlePose part = PoseBetween(RestOf(pose), pose, amount);
  part.pivot_mm = pose.pivot_mm;  // mixed with itself it would be rounded
  return part;
}

}  // namespace tissueform
