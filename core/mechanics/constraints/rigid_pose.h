// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/rigid_move.h"

namespace tissueform {

// The movement as the pose of a handle about a pivot.
HandlePose PoseOf(const RigidMove& move, const Eigen::Vector3d& pivot_mm);

// The movement of a handle. REQUIRES: a scale of 1.
RigidMove MoveOf(const HandlePose& pose);

}  // namespace tissueform
