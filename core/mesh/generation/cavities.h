// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// One point in every cavity of a surface, for TetGen to know what stays empty.
//
// A cavity is a connected component of the surface that faces the other way than the component that
// encloses most: the wall of a hole inside. The point lies halfway between two opposite places of
// the wall, where the cavity is wide. In the order of the components' lowest vertices.
//
// REQUIRES: the surface is closed, without intersections and without degenerate triangles.
std::vector<Eigen::Vector3d> CavityPoints(const TriangleMesh& surface);

}  // namespace tissueform
