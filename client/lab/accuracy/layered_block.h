// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// A block of soft tissue of 80 x 60 x 20 mm on bone: from below muscle (10 mm, 30 kPa), fat
// (7.5 mm, 3 kPa) and skin (2.5 mm, 100 kPa). The handle "patch" is the middle third of the bottom
// in both directions (26.7 x 20 mm), the piece of bone that is moved; a rim of the bottom, 13.3 mm
// wide, is fixed. Between them, where the bone was cut, the bottom is as free as the sides and the
// top: were it fixed up to the patch, a patch that moves by more than a cell along would pass
// through fixed vertices, and no answer would keep every tet positive.
struct LayeredBlock {
  TetMesh mesh;
  Eigen::VectorXd stiffness;  // Pa, #T
  ConstraintSet constraints;
};

// Cells along x, y and z: 20,736 tets.
inline constexpr std::array<int, 3> kLayeredBlockCells = {24, 18, 8};

// Layers, patch and rim are met exactly when the cells are multiples of 12, 9 and 8, so that meshes
// can be compared; otherwise a cell belongs to the layer of its middle, and patch and rim are the
// vertices that lie in them.
//
// Errors: InvalidArgument when no vertex lies in the patch.
absl::StatusOr<LayeredBlock> MakeLayeredBlock(const std::array<int, 3>& cells = kLayeredBlockCells);

// The patch moved by 5 mm along x, and by 5 mm up into the tissue.
HandlePose MoveAlong();
HandlePose MoveUp();

}  // namespace tissueform
