// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The movement that a text file of ITK transforms (.tfm, .txt) describes. Such files map points of
// the image after the movement to the image before it, as resampling needs them: the movement is
// the inverse. Known are AffineTransform, MatrixOffsetTransformBase, Euler3DTransform,
// VersorRigid3DTransform and TranslationTransform, alone in their file.
//
// Errors: InvalidArgument when the text is not such a file, or the transform is not rigid: with
// scale, shear or a reflection.
absl::StatusOr<RigidMove> ParseItkTransform(const std::string& text);

struct RigidFit {
  RigidMove move;
  double rms_mm = 0;  // of the moved piece's vertices from the target
};

// The rigid movement that takes a surface to a second one of the same piece. Surfaces with the same
// triangles are compared vertex by vertex. Otherwise points of the first are taken to the nearest
// of the second until they rest, from where the centers agree; the surfaces may then be rotated by
// up to about 20 degrees and must be triangulated about as far.
//
// Errors: InvalidArgument when the fit leaves more than 1.5 mm RMS: these are different pieces.
absl::StatusOr<RigidFit> FitRigidly(const TriangleMesh& from, const TriangleMesh& to);

// "moves 6.0 mm backward, 0.5 mm up, 0.0 mm left, and turns by 1.2 degrees", at the pivot.
std::string MoveText(const HandlePose& pose);

}  // namespace tissueform
