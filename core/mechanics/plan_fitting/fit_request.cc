// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_request.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

absl::Status Refuse(const std::string& what, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(what, ": ", why));
}

bool IsFinite(const std::optional<Vector3d>& vector) {
  return !vector.has_value() || vector->allFinite();
}

absl::Status CheckWish(const FitTargetRequest& target, const std::string& what) {
  const int wishes = (target.position_mm.has_value() ? 1 : 0) +
                     (target.displacement_mm.has_value() ? 1 : 0) +
                     (target.direction.has_value() ? 1 : 0);
  if (wishes != 1) {
    return Refuse(what, "it must have one goal: move_mm, along with by_mm, or to_mm");
  }
  if (target.direction.has_value() && target.direction->isZero(0)) {
    return Refuse(what, "its direction has no length");
  }
  return absl::OkStatus();
}

absl::Status CheckTarget(const FitTargetRequest& target) {
  const std::string what = absl::StrCat("target \"", target.name, "\"");
  if (target.point_mm.has_value() != target.vertices.empty()) {
    return Refuse(what, "it must have one location: a point on the skin, or a place");
  }
  if (!IsFinite(target.point_mm) || !IsFinite(target.position_mm) ||
      !IsFinite(target.displacement_mm) || !IsFinite(target.direction) ||
      !std::isfinite(target.movement_mm)) {
    return Refuse(what, "a number is NaN or infinite; give finite ones");
  }
  if (!(target.weight > 0 && target.weight <= kMaxTargetWeight)) {
    return Refuse(what,
                  absl::StrCat("its weight is ", target.weight, "; it must be above 0 and at most ",
                               kMaxTargetWeight, "; remove a target without weight"));
  }
  return CheckWish(target, what);
}

// One of the two kinds of numbers that a pose has.
struct RangeKind {
  absl::string_view name;
  double most;
  absl::string_view most_in_words;
};
constexpr RangeKind kRotation = {"rotation about ", kMaxFitRotation, "90 degrees"};
constexpr RangeKind kTranslation = {"translation along ", kMaxFitTranslationMm, "1000 mm"};

absl::Status CheckRanges(const std::array<FitFreedom::Range, 3>& ranges, const RangeKind& kind,
                         const std::string& what) {
  for (size_t axis = 0; axis < ranges.size(); ++axis) {
    if (!ranges[axis].has_value()) continue;
    const auto [lower, upper] = *ranges[axis];
    const std::string number = absl::StrCat(kind.name, absl::string_view("xyz").substr(axis, 1));
    if (!std::isfinite(lower) || !std::isfinite(upper)) {
      return Refuse(what, absl::StrCat("a bound of its ", number, " is NaN or infinite"));
    }
    if (lower > upper) {
      return Refuse(what, absl::StrCat("the bounds of its ", number,
                                       " are reversed: the lower one is above the upper one"));
    }
    constexpr double kRounding = 1 + 1e-12;  // degrees became radians
    if (std::max(-lower, upper) > kind.most * kRounding) {
      return Refuse(what, absl::StrCat("the bounds of its ", number, " exceed ", kind.most_in_words,
                                       "; give tighter ones"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckFreedom(const FitFreedom& freedom) {
  const std::string what = absl::StrCat("free handle \"", freedom.handle, "\"");
  if (!IsFinite(freedom.pivot_mm)) return Refuse(what, "its pivot_mm is NaN or infinite");
  TF_RETURN_IF_ERROR(CheckRanges(freedom.rotation, kRotation, what));
  return CheckRanges(freedom.translation, kTranslation, what);
}

absl::Status CheckSettings(const FitRequest& request) {
  if (!(request.less_movement >= 0 && request.less_movement <= 1)) {
    return absl::InvalidArgumentError(absl::StrCat("less_movement is ", request.less_movement,
                                                   "; it must be at least 0 and at most 1"));
  }
  if (!(request.tolerance_mm > 0 && std::isfinite(request.tolerance_mm))) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance_mm is ", request.tolerance_mm, "; it must be a positive number"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckFitRequest(const FitRequest& request) {
  if (request.targets.empty()) {
    return absl::InvalidArgumentError("there are no targets");
  }
  if (request.targets.size() > kMaxFitTargets) {
    return absl::InvalidArgumentError(absl::StrCat(
        "there are ", request.targets.size(), " targets; at most ", kMaxFitTargets, " are read"));
  }
  TF_RETURN_IF_ERROR(CheckSettings(request));
  std::set<std::string> names;
  size_t num_vertices = 0;
  for (const FitTargetRequest& target : request.targets) {
    num_vertices += target.vertices.size();
    if (num_vertices > kMaxFitVertices) {
      return Refuse(absl::StrCat("target \"", target.name, "\""),
                    absl::StrCat("the targets name more than ", kMaxFitVertices,
                                 " vertices together; name fewer, or points"));
    }
    TF_RETURN_IF_ERROR(CheckTarget(target));
    if (!names.insert(target.name).second) {
      return Refuse(absl::StrCat("target \"", target.name, "\""),
                    "the name is not unique; rename it");
    }
  }
  std::set<std::string> handles;
  for (const FitFreedom& freedom : request.moving) {
    TF_RETURN_IF_ERROR(CheckFreedom(freedom));
    if (!handles.insert(freedom.handle).second) {
      return Refuse(absl::StrCat("free handle \"", freedom.handle, "\""),
                    "it is listed twice; put its bounds together");
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
