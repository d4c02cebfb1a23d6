// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/head_frame.h"
#include "core/mesh/rigid_move.h"
#include "core/mesh/triangle_mesh.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// A segment's movement by the operation, about the case's pivot, in the pre-operative coordinates.
struct SegmentMovement {
  std::string handle;
  HandlePose planned;
  HandlePose real;  // the planned one where no bone was scanned
  bool measured = false;
  double rms_mm = 0;  // of the registered piece, where measured
  double share = 0;   // of its points that were used
  // What real adds to planned, at the pivot, in the head frame: left, posterior, superior.
  Eigen::Vector3d deviation_mm = Eigen::Vector3d::Zero();
  HeadAngles deviation_deg;
};

// The movement of each segment of the case: its pre-operative piece with its teeth registered to
// the post-operative bone, from its planned place, from rest, and from where the segments before it
// were found; the best fit counts. `bone` lies
// in the pre-operative coordinates (HeadRegistration::to_pre); without it the plan's poses are
// used.
std::vector<SegmentMovement> MeasureSegments(const CaseFile& contents, const TriangleMesh* bone);

// How far the mouth is opened beyond the plan, by the lower jaw's deviation about the hinge through
// both condyles.
struct MouthOpening {
  double degrees = 0;  // positive: open
  RigidMove hinge;     // the turn that opens by this angle
};

// Empty where the plan does not move the lower jaw, its movement was not measured, the case has no
// condyles, or the deviation is not mainly a turn about the hinge.
std::optional<MouthOpening> FindOpening(const CaseFile& contents,
                                        const std::vector<SegmentMovement>& segments);

}  // namespace tissueform
