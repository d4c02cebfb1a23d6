// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include <Eigen/Core>

#include "core/mechanics/constraints/handle_pose.h"

namespace tissueform {

// Where a patient's left, back and top are, in LPS: the axes x, y, z in which a planner moves and
// turns bone. By the Frankfort horizontal and the midsagittal plane, where those are known.
struct HeadFrame {
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  // Unit vectors at right angles; superior = left x posterior.
  Eigen::Vector3d left = Eigen::Vector3d::UnitX();
  Eigen::Vector3d posterior = Eigen::Vector3d::UnitY();
  Eigen::Vector3d superior = Eigen::Vector3d::UnitZ();
  // Where it is from: "landmarks", "recipe", or "scanner" where nothing better was found.
  std::string source = "scanner";

  // Columns left, posterior, superior: from the frame's axes to LPS.
  Eigen::Matrix3d ToLps() const;
};

// InvalidArgument: axes that are no unit vectors, not at right angles, or left-handed.
absl::Status CheckHeadFrame(const HeadFrame& frame);

// Turns of a segment in degrees, for people. Positive pitch raises what lies in front of the pivot
// (the chin goes up), positive roll lowers the patient's left side, positive yaw turns what lies in
// front to the patient's left. First rolled, then pitched, then yawed about the fixed axes of the
// frame:
//
//   R = Rz(yaw) Rx(-pitch) Ry(roll)   (x, y, z: left, posterior, superior)
struct HeadAngles {
  double pitch_deg = 0;
  double roll_deg = 0;
  double yaw_deg = 0;
};

// The rotation vector in LPS, in radians, of half a turn at most.
Eigen::Vector3d RotationVectorFromAngles(const HeadAngles& angles, const HeadFrame& frame);

// The angles of a rotation vector in LPS: pitch from -90 to 90 degrees, roll and yaw from -180 to
// 180. At a pitch of +-90 degrees, where roll and yaw do the same, yaw is 0. Full turns are lost.
HeadAngles AnglesFromRotationVector(const Eigen::Vector3d& rotation_vector, const HeadFrame& frame);

}  // namespace tissueform
