// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// Most unknowns of a fit: six a segment, for four of them. The usual most is 18.
inline constexpr size_t kMaxFitUnknowns = 24;
inline constexpr size_t kMaxFitTargets = 256;
// That targets name, all together.
inline constexpr size_t kMaxFitVertices = 20000;
// How far from the skin a point may be given: what a mesh of a face is off its CT.
inline constexpr double kMaxOffSkinMm = 2.0;
// Farther than any segment turns, and than answers can be prepared for.
inline constexpr double kMaxFitRotation = std::numbers::pi / 2;
inline constexpr double kMaxFitTranslationMm = 1000;
inline constexpr double kMaxTargetWeight = 1e6;

// What is wanted of one point, in the axes of the request.
struct FitTargetRequest {
  std::string name;
  // Where the point is at rest: a point on the skin; without one, the mean of the vertices.
  std::optional<Eigen::Vector3d> point_mm = std::nullopt;
  std::vector<int32_t> vertices = {};
  // One of: where it is to be; which way and how far it is to go; how far along a direction of any
  // length but zero, free across it.
  std::optional<Eigen::Vector3d> position_mm = std::nullopt;
  std::optional<Eigen::Vector3d> displacement_mm = std::nullopt;
  std::optional<Eigen::Vector3d> direction = std::nullopt;
  double movement_mm = 0;
  double weight = 1;  // of the squared miss
};

// What may be found of one handle's pose: radians and mm, from the first to the second.
struct FitFreedom {
  using Range = std::optional<std::array<double, 2>>;
  std::string handle;
  std::array<Range, 3> rotation = {};     // components of the rotation vector
  std::array<Range, 3> translation = {};  // of the pivot
  std::optional<Eigen::Vector3d> pivot_mm = std::nullopt;
};

struct FitRequest {
  CoordinateSystem axes = CoordinateSystem::kLps;  // of all that follows
  std::vector<FitTargetRequest> targets = {};
  std::vector<FitFreedom> moving = {};
  // Handles move as the midsagittal plane lets them, which is across x: no translation along x, no
  // turn about y and z.
  bool symmetric = false;
  // Among equals the least movement of bone is taken: 1 mm of it (root mean square over a handle's
  // vertices, from rest) weighs as much as a miss of so many mm by a target of weight 1.
  double less_movement = 0.02;
  double tolerance_mm = 0.5;  // a target that is missed by more is not reached
};

// Checks what can be checked of a request without mesh and plan.
//
// Errors: InvalidArgument, in one line that names the target or the handle: no target, more of them
// than kMaxFitTargets or of vertices than kMaxFitVertices, a name twice; a number that is not
// finite; a weight that is not positive; a direction without length; none or several of the forms
// of a point and of what is wanted; bounds that cross or lie beyond kMaxFitRotation or
// kMaxFitTranslationMm; a handle twice.
absl::Status CheckFitRequest(const FitRequest& request);

}  // namespace tissueform
