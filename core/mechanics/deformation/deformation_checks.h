// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include <Eigen/Core>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// InvalidArgument, naming the handle, unless there is one legal pose per handle (see CheckPose).
absl::Status CheckPoses(const ConstraintSet& constraints, absl::Span<const HandlePose> poses);

// InvalidArgument, naming the first offending cell, unless there is one positive finite stiffness,
// in Pa, per cell. `cell_name` is "tet" or "triangle".
absl::Status CheckStiffness(Eigen::Index num_cells, const Eigen::VectorXd& stiffness,
                            absl::string_view cell_name);

// InvalidArgument where tissue slides or lifts off, for `who` ("arap"), who cannot compute that.
absl::Status CheckWithoutContact(const ConstraintSet& constraints, absl::string_view who);

// InvalidArgument, naming the row, where the `compliance` of one of the contact rows `rows` is
// rounding beside that which is `typical` for it. All three have the same length.
absl::Status CheckContactMoves(const Eigen::VectorXd& typical, const Eigen::VectorXd& compliance,
                               const std::vector<int32_t>& rows);

// InvalidArgument unless it is a positive number.
absl::Status CheckTolerance(double tolerance_mm);

// InvalidArgument, naming the first offending vertex, unless at least one is chosen and all are in
// [0, num_vertices).
absl::Status CheckChosenVertices(const std::vector<int32_t>& vertices, Eigen::Index num_vertices);

// InvalidArgument unless max_iterations is at least 1 and tolerance_mm a positive number.
absl::Status CheckIteration(int max_iterations, double tolerance_mm);

}  // namespace tissueform
