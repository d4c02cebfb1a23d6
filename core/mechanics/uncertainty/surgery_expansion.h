// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/uncertainty/material_expansion.h"

namespace tissueform {

// By how much surgery misses the plan of a segment: standard deviations along and about the
// patient's left, back and top. The translation is that of the segment's front, where the teeth
// are, about which it turns.
//
// The defaults are of 24 patients (docs/accuracy.md, "The whole band"): 0.61 +- 0.55, 0.86 +- 0.68
// and 1.00 +- 0.79 mm of absolute deviation, each the root of mean^2 + SD^2; 1.43, 0.50 and 0.58
// degrees, whose axes are not known to us, so that each axis has the mean square of the three.
struct SurgeryDeviation {
  Eigen::Vector3d translation_mm = {0.82, 1.10, 1.27};
  Eigen::Vector3d rotation_deg = {1.17, 1.17, 1.17};
};

// How the answer at `poses` changes when segments are placed elsewhere: six variables a handle that
// the poses move, three of translation and three of rotation, in first order and by the responses
// of linear elasticity at rest, regardless of the model that gave the answer. `axes` has the
// patient's left, back and top in its columns, in LPS. With contact the rows that hold `deformed`
// (#V by 3) stay closed, and no others close.
//
// Errors: those of MeshPreparation::Elastic and Contact.
absl::StatusOr<AnswerExpansion> ExpandSurgery(MeshPreparation* preparation,
                                              absl::Span<const HandlePose> poses,
                                              const Positions& deformed,
                                              const Eigen::Matrix3d& axes,
                                              const SurgeryDeviation& deviation);

// `more` has variables of its own.
void Append(const AnswerExpansion& more, AnswerExpansion* expansion);

}  // namespace tissueform
