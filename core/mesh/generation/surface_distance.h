// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Distances of points (#P by 3) to the nearest point of a surface, #P, in mm. By a search tree
// (CGAL). They do not depend on `threads`.
//
// REQUIRES: positions are finite.
Eigen::VectorXd DistancesToSurface(const Positions& points, const TriangleMesh& surface,
                                   int threads = 1);

}  // namespace tissueform
