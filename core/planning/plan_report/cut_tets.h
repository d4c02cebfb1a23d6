// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/imaging/anatomy/plane.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// The boundary of those tets whose barycenter is on the positive side of the plane, colored by
// colours[t] of the tet t that a triangle belongs to. Empty if there are no such tets.
SurfaceLayer CutTets(const TetMesh& mesh, const Plane& plane, const std::vector<Colour>& colours);

}  // namespace tissueform
