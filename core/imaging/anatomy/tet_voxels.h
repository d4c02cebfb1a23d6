// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// Calls visit(tet, x, y, z) for every voxel of the grid whose centre lies in a tet, tet after tet.
// A centre on a face, edge or vertex belongs to the first of the tets that meet there (the test of
// a face is computed alike from both its sides, so that no centre falls between them); no voxel is
// visited twice, also where tets overlap. Tets without volume have no voxels.
//
// REQUIRES: positions are finite.
void ForEachVoxelInTets(const TetMesh& mesh, const GridGeometry& grid,
                        const std::function<void(Eigen::Index tet, int x, int y, int z)>& visit);

}  // namespace tissueform
