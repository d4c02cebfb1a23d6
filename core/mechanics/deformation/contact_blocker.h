// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// Where tissue is squeezed most, and the two regions that it lies between.
struct ContactBlocker {
  Eigen::Index tet = -1;    // the worst, in the mesh's numbering
  double volume_ratio = 0;  // of it: deformed over rest volume; not positive: inside out
  // Each the index of a handle or ConstraintSet::kFixed; the first is the nearer one. Alike where
  // nothing else constrains this part of the mesh.
  int first = ConstraintSet::kFixed;
  int second = ConstraintSet::kFixed;
};

// Looks at positions (#V by 3, mm), also such as invert tets: the worst tet is that whose volume is
// the smallest part of that at rest, the regions are the first two that a walk along the edges
// from there comes to. REQUIRES: a tet.
ContactBlocker FindObstacle(const MeshPreparation& preparation, const Positions& positions);

// The first handle, with the region, whose middle passes through that region between two sets of
// poses: meets one of the faces of tets whose corners all belong to it. Energies know nothing of
// this, since tissue may be led around the region with all its tets positive. Parts that touch at
// their rims are not meant: soft tissue between them gives way.
std::optional<ContactBlocker> FindCrossing(const MeshPreparation& preparation,
                                           absl::Span<const HandlePose> before,
                                           absl::Span<const HandlePose> after);

// "handle "left" would pass through handle "right"", or "... through the fixed vertices", where the
// worst tet is inside out or a handle crosses; otherwise "the tissue between ... is squeezed to 2 %
// of its volume".
std::string Describe(const ContactBlocker& obstacle, const ConstraintSet& constraints);

}  // namespace tissueform
