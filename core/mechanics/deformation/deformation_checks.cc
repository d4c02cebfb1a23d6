// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/deformation_checks.h"

#include <cmath>

#include "absl/strings/str_cat.h"

namespace tissueform {

absl::Status CheckPoses(const ConstraintSet& constraints, absl::Span<const HandlePose> poses) {
  if (poses.size() != constraints.handles().size()) {
    return absl::InvalidArgumentError(absl::StrCat("got ", poses.size(), " poses for ",
                                                   constraints.handles().size(),
                                                   " handles; give one pose for each handle"));
  }
  for (size_t h = 0; h < poses.size(); ++h) {
    if (const absl::Status status = CheckPose(poses[h]); !status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("handle \"", constraints.handles()[h].name, "\": ", status.message()));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckStiffness(Eigen::Index num_cells, const Eigen::VectorXd& stiffness,
                            absl::string_view cell_name) {
  if (stiffness.size() != num_cells) {
    return absl::InvalidArgumentError(absl::StrCat("stiffness has ", stiffness.size(),
                                                   " values for ", num_cells, " ", cell_name,
                                                   "s; give one for each ", cell_name));
  }
  for (Eigen::Index c = 0; c < stiffness.size(); ++c) {
    if (!std::isfinite(stiffness[c]) || stiffness[c] <= 0) {
      return absl::InvalidArgumentError(absl::StrCat("stiffness of ", cell_name, " ", c, " is ",
                                                     stiffness[c],
                                                     " Pa; it must be a positive number"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckWithoutContact(const ConstraintSet& constraints, absl::string_view who) {
  if (constraints.contact().empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(who, " does not compute contact; leave out the contact rows"));
}

absl::Status CheckContactMoves(const Eigen::VectorXd& typical, const Eigen::VectorXd& compliance,
                               const std::vector<int32_t>& rows) {
  constexpr double kNoCompliance = 1e-10;
  for (Eigen::Index r = 0; r < compliance.size(); ++r) {
    if (compliance[r] > kNoCompliance * typical[r]) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("contact row ", rows[static_cast<size_t>(r)],
                     " cannot move: its vertex slides along that normal; remove the row"));
  }
  return absl::OkStatus();
}

absl::Status CheckTolerance(double tolerance_mm) {
  if (!std::isfinite(tolerance_mm) || tolerance_mm <= 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance_mm is ", tolerance_mm, "; it must be a positive number"));
  }
  return absl::OkStatus();
}

absl::Status CheckChosenVertices(const std::vector<int32_t>& vertices, Eigen::Index num_vertices) {
  if (vertices.empty()) {
    return absl::InvalidArgumentError("no vertices are chosen; name at least one");
  }
  for (const int32_t v : vertices) {
    if (v < 0 || v >= num_vertices) {
      return absl::InvalidArgumentError(
          absl::StrCat("chosen vertex ", v, " is outside 0 to ", num_vertices - 1));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckIteration(int max_iterations, double tolerance_mm) {
  if (max_iterations < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_iterations is ", max_iterations, "; it must be at least 1"));
  }
  return CheckTolerance(tolerance_mm);
}

}  // namespace tissueform
