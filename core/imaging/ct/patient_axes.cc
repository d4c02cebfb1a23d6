// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/patient_axes.h"

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kToward[] = "LPS";  // where x, y, z of the patient grow toward
constexpr char kFrom[] = "RAI";
constexpr double kSameDirection = 1e-6;

constexpr char kExplanation[] =
    "three letters, the patient directions in which its x, y and z increase: L or R, A or P, S or "
    "I "
    "(\"LPS\": left, back, head)";

// The patient's axis of a letter, or -1.
int AxisOf(char letter) {
  for (int axis = 0; axis < 3; ++axis) {
    if (letter == kToward[axis] || letter == kFrom[axis]) return axis;
  }
  return -1;
}

absl::Status Contradicts(const std::string& axes, const std::string& stated) {
  return absl::InvalidArgumentError(
      absl::StrCat("\"axes\": \"", axes, "\" of the recipe contradicts the file, whose axes are \"",
                   stated, "\"; correct the recipe or remove the key"));
}

}  // namespace

absl::Status CheckAxes(const std::string& axes) {
  int seen = 0;
  for (const char letter : axes) {
    const int axis = AxisOf(letter);
    seen |= axis < 0 ? 0 : 1 << axis;
  }
  if (axes.size() == 3 && seen == 7) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("\"axes\" of the recipe must be ", kExplanation));
}

Eigen::Matrix3d DirectionOf(const std::string& axes) {
  Eigen::Matrix3d direction = Eigen::Matrix3d::Zero();
  for (int column = 0; column < 3; ++column) {
    const char letter = axes[static_cast<size_t>(column)];
    for (int axis = 0; axis < 3; ++axis) {
      if (letter == kToward[axis]) direction(axis, column) = 1;
      if (letter == kFrom[axis]) direction(axis, column) = -1;
    }
  }
  return direction;
}

std::string AxesOf(const Eigen::Matrix3d& direction) {
  std::string axes;
  for (int column = 0; column < 3; ++column) {
    Eigen::Index axis = 0;
    direction.col(column).cwiseAbs().maxCoeff(&axis);
    axes += direction(axis, column) > 0 ? kToward[axis] : kFrom[axis];
  }
  return axes;
}

absl::Status PlaceVolume(bool stated, const std::string& where, const std::string& axes,
                         CtVolume* volume) {
  if (!axes.empty()) TF_RETURN_IF_ERROR(CheckAxes(axes));
  const bool upright = volume->direction.isIdentity(kSameDirection);
  if (!stated && axes.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the file does not say how it lies in the patient (", where,
                     "); add \"axes\" to the recipe: ", kExplanation));
  }
  if (!stated && upright) {
    volume->direction = DirectionOf(axes);
    volume->origin_mm = volume->direction * volume->origin_mm;
    return absl::OkStatus();
  }
  const std::string own = AxesOf(volume->direction);
  return axes.empty() || axes == own ? absl::OkStatus() : Contradicts(axes, own);
}

}  // namespace tissueform
