// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/fit_conversion.h"

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"

namespace tissueform {
namespace {

Eigen::Vector3d VectorOf(const v1::Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

v1::Vector3 ToVector3(const Eigen::Vector3d& vector) {
  v1::Vector3 proto;
  proto.set_x(vector.x());
  proto.set_y(vector.y());
  proto.set_z(vector.z());
  return proto;
}

FitFreedom::Range RangeOf(bool is_given, const v1::FitRange& range) {
  return is_given ? FitFreedom::Range({range.lowest(), range.highest()}) : std::nullopt;
}

std::array<FitFreedom::Range, 3> RangesOf(const v1::FitRanges& ranges) {
  return {RangeOf(ranges.has_x(), ranges.x()), RangeOf(ranges.has_y(), ranges.y()),
          RangeOf(ranges.has_z(), ranges.z())};
}

absl::StatusOr<FitTargetRequest> ToTarget(const v1::FitTarget& proto) {
  FitTargetRequest target{.name = proto.name()};
  switch (proto.at_case()) {
    case v1::FitTarget::kPointMm:
      target.point_mm = VectorOf(proto.point_mm());
      break;
    case v1::FitTarget::kVertices:
      target.vertices.assign(proto.vertices().vertices().begin(),
                             proto.vertices().vertices().end());
      break;
    case v1::FitTarget::AT_NOT_SET:
      return absl::InvalidArgumentError(
          absl::StrCat("target \"", proto.name(), "\" has no position; set point_mm or vertices"));
  }
  switch (proto.wanted_case()) {
    case v1::FitTarget::kPositionMm:
      target.position_mm = VectorOf(proto.position_mm());
      break;
    case v1::FitTarget::kDisplacementMm:
      target.displacement_mm = VectorOf(proto.displacement_mm());
      break;
    case v1::FitTarget::kMovement:
      target.direction = VectorOf(proto.movement().direction());
      target.movement_mm = proto.movement().by_mm();
      break;
    case v1::FitTarget::WANTED_NOT_SET:
      return absl::InvalidArgumentError(
          absl::StrCat("target \"", proto.name(),
                       "\" has no goal; set position_mm, displacement_mm or movement"));
  }
  if (proto.has_weight()) target.weight = proto.weight();
  return target;
}

v1::FitBound ToProto(ActiveBound bound) {
  switch (bound) {
    case ActiveBound::kNone:
      break;
    case ActiveBound::kLower:
      return v1::FIT_BOUND_LOWEST;
    case ActiveBound::kUpper:
      return v1::FIT_BOUND_HIGHEST;
  }
  return v1::FIT_BOUND_UNSPECIFIED;
}

v1::FittedNumber ToProto(const FitProblem& problem, const FitUnknown& unknown,
                         const FittedUnknown& found) {
  v1::FittedNumber proto;
  proto.set_handle(problem.handle_names[unknown.handle]);
  proto.set_is_rotation(unknown.is_rotation);
  proto.set_axis(unknown.axis);
  proto.set_value(found.value);
  proto.set_bound(ToProto(found.bound));
  proto.set_by_targets(found.determination.by_targets);
  proto.set_error_per_mm(found.determination.error_per_mm);
  return proto;
}

v1::FittedTarget ToProto(const FitProblem& problem, const FitTarget& target,
                         const FittedTarget& fitted) {
  v1::FittedTarget proto;
  proto.set_name(target.name);
  proto.set_reached(fitted.missed_mm <= problem.tolerance_mm);
  proto.set_missed_mm(fitted.missed_mm);
  *proto.mutable_position_mm() = ToVector3(fitted.position_mm);
  *proto.mutable_displacement_mm() = ToVector3(fitted.position_mm - target.rest_mm);
  return proto;
}

}  // namespace

absl::StatusOr<FitRequest> ToFitRequest(const v1::FitRequest& proto) {
  FitRequest request{.symmetric = proto.symmetric()};
  for (const v1::FitTarget& target : proto.targets()) {
    TF_ASSIGN_OR_RETURN(request.targets.emplace_back(), ToTarget(target));
  }
  for (const v1::FitFreedom& freedom : proto.freedoms()) {
    request.moving.push_back({.handle = freedom.handle(),
                              .rotation = RangesOf(freedom.rotation_vector()),
                              .translation = RangesOf(freedom.translation_mm()),
                              .pivot_mm = freedom.has_pivot_mm()
                                              ? std::optional(VectorOf(freedom.pivot_mm()))
                                              : std::nullopt});
  }
  if (proto.has_less_movement()) request.less_movement = proto.less_movement();
  if (proto.has_tolerance_mm()) request.tolerance_mm = proto.tolerance_mm();
  return request;
}

v1::FitResponse ToProto(const FitProblem& problem, const PlanFit& fit) {
  v1::FitResponse proto;
  for (size_t h = 0; h < fit.poses.size(); ++h) {
    *proto.add_poses() = ToProto(NamedPose{problem.handle_names[h], fit.poses[h]});
  }
  for (size_t i = 0; i < fit.unknowns.size(); ++i) {
    *proto.add_numbers() = ToProto(problem, problem.unknowns[i], fit.unknowns[i]);
  }
  for (size_t t = 0; t < fit.targets.size(); ++t) {
    *proto.add_targets() = ToProto(problem, problem.targets[t], fit.targets[t]);
  }
  for (const auto& [first, second] : fit.contradictions) {
    v1::ContradictoryTargets* pair = proto.add_contradictions();
    pair->set_first(problem.targets[first].name);
    pair->set_second(problem.targets[second].name);
  }
  proto.set_movement_mm(fit.movement_mm);
  proto.set_converged(fit.converged);
  proto.set_iterations(fit.iterations);
  proto.set_model_converged(fit.verified && fit.model_converged);
  proto.set_prepared_error_mm(fit.prepared_error_mm);
  proto.set_search_seconds(fit.search_seconds);
  return proto;
}

}  // namespace tissueform
