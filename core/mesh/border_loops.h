// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The openings of a surface: vertices in the order in which the border runs, along the triangles'
// edges that no other triangle has. Where borders meet in a vertex they are split there, so that
// no loop holds a vertex twice. Borders that do not return to their start (triangles face both
// ways) end where they end. Deterministic.
std::vector<std::vector<int32_t>> BorderLoops(const TriangleMesh& mesh);

// Largest extent of a loop along an axis, in mm: about how wide the opening is.
double LoopWidthMm(const TriangleMesh& mesh, const std::vector<int32_t>& loop);

// The surface with every opening closed by triangles from its border to its center; the centers
// follow the mesh's vertices, one for each loop, and the new triangles its triangles.
TriangleMesh WithOpeningsClosed(const TriangleMesh& mesh,
                                const std::vector<std::vector<int32_t>>& loops);

}  // namespace tissueform
