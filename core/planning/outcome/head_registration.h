// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/generation/rigid_registration.h"
#include "core/mesh/rigid_move.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The head after the operation, in the coordinates of its own scan, mm.
struct PostOperativeHead {
  TriangleMesh skin;
  std::optional<TriangleMesh> bone;  // all bone and teeth; empty: a photograph
};

// Where the post-operative scan lies in the pre-operative coordinates.
struct HeadRegistration {
  RigidMove to_pre;     // post-operative coordinates to pre-operative ones
  double rms_mm = 0;    // of the unmoved points that were used
  double share = 0;     // of the unmoved points that were used
  double score_mm = 0;  // Registration::score_mm
};

// Finds a post-operative surface by what was not operated. `unmoved` are points of the
// pre-operative head that the operation did not move, LPS. Starts from several turns up to 25
// degrees; half a turn and the mirror image are tried, to be refused.
//
// Errors (InvalidArgument): a surface in meters; one in RAS; a mirrored one. FailedPrecondition:
// too little unmoved surface; a fit that leaves more than two persons differ: another patient.
absl::StatusOr<HeadRegistration> RegisterHead(const OrientedPoints& unmoved,
                                              const TriangleMesh& post, bool is_bone);

// The surface in the pre-operative coordinates.
TriangleMesh Moved(const TriangleMesh& mesh, const RigidMove& move);

}  // namespace tissueform
