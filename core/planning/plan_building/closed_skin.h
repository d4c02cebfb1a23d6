// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh/triangle_mesh.h"
#include "core/planning/plan_building/solid_voxels.h"

namespace tissueform {

// A skin whose inside is known.
struct ClosedSkin {
  TriangleMesh skin;                 // with openings closed, apart from those of `open`
  OpenBox open;                      // faces of the skin's box at which it is open
  std::optional<TriangleMesh> caps;  // what closes the wide openings, and the open faces

  // All that bounds the head. Caps may be in it twice: it is for distances only.
  TriangleMesh WithCaps() const;
};

// The box of the vertices that triangles have.
Eigen::AlignedBox3d BoxOf(const TriangleMesh& mesh);

// Closes the openings of a skin (MakeHeadFromSurfaces states how) and adds notes on what was done.
ClosedSkin CloseSkin(const TriangleMesh& skin, std::vector<std::string>* notes);

}  // namespace tissueform
