// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// Up to here the skin of a head goes with the skin of the mesh, and from there on less, to not at
// all. Where the modelled region ends the mesh does not move either, so that no step is seen.
inline constexpr double kFollowsFullyMm = 3;
inline constexpr double kFollowsMm = 8;

// How the vertices of a head's skin follow the tet mesh that models a part of it: each the nearest
// point of the mesh's skin that faces as it does (so that an upper lip does not follow the lower
// one). The mesh's skin are the facets with a free vertex.
FollowedVertices FollowSkin(const FloatPositions& positions, const TriangleIndices& triangles,
                            const TetMesh& mesh, const ConstraintSet& constraints);

// Of each vertex the region of the mesh's vertex that it follows most; 0 where it follows none.
// `region_of_vertex` is #V of the mesh, or empty: then the result is, too.
std::vector<uint8_t> RegionsOfFollowers(const FollowedVertices& follows,
                                        const std::vector<uint8_t>& region_of_vertex);

}  // namespace tissueform
