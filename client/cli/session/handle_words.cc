// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/handle_words.h"

#include <array>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace tissueform {
namespace {

// Only along an axis, with less than 8 degrees beside it (cosine 0.99): "forward" for a move that
// also goes up would state half of it.
std::string DirectionInWords(const Eigen::Vector3d& move) {
  struct AxisWords {
    const char* negative;
    const char* positive;
  };
  constexpr std::array<AxisWords, 3> kWords = {
      {{" to the right", " to the left"}, {" forward", " back"}, {" down", " up"}}};
  Eigen::Index axis = 0;
  const double along = move.cwiseAbs().maxCoeff(&axis);
  if (along < 0.99 * move.norm()) return "";
  const AxisWords& words = kWords[static_cast<size_t>(axis)];
  return move[axis] < 0 ? words.negative : words.positive;
}

std::string MoveInWords(const std::string& name, const HandlePose& pose) {
  std::vector<std::string> parts;
  const double turned_deg = pose.rotation_vector.norm() * 180 / M_PI;
  if (pose.translation_mm.norm() > 0) {
    parts.push_back(absl::StrFormat("%.3g mm%s", pose.translation_mm.norm(),
                                    DirectionInWords(pose.translation_mm)));
  }
  if (turned_deg > 0) parts.push_back(absl::StrFormat("turned by %.3g degrees", turned_deg));
  if (pose.scale != 1) parts.push_back(absl::StrFormat("scaled by %.3g", pose.scale));
  return absl::StrCat(name, " ", parts.empty() ? "at rest" : absl::StrJoin(parts, ", "));
}

}  // namespace

std::string MovesInWords(const PlanProblem& problem) {
  std::vector<std::string> moves;
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    moves.push_back(MoveInWords(problem.constraints.handles()[h].name, problem.poses[h]));
  }
  return absl::StrJoin(moves, "; ");
}

}  // namespace tissueform
