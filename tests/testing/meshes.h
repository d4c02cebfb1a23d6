// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mesh/tet_mesh.h"

// Meshes that tests and benchmarks share.
namespace tissueform::testing {

// One positive tet that is neither regular nor aligned with the axes.
TetMesh SingleTet();

// Grid of cubes of `cell_mm`, six positive tets a cube; cells {10, 10, 20} gives the first bar of
// the source's Table 1. Inner and outer vertices are moved at random by up to `jitter` times the
// cell (0.2 keeps all tets positive). Vertex (i, j, k) has the number i + (nx + 1) * (j + (ny + 1)
// * k); the bar runs along z.
TetMesh Bar(const std::array<int, 3>& cells, double cell_mm = 1.0, double jitter = 0.0,
            uint32_t seed = 1);

// Vertices for which `inside` holds, rising.
std::vector<int32_t> SelectVertices(const TetMesh& mesh,
                                    const std::function<bool(const Eigen::Vector3d&)>& inside);

// The lowest layer of a bar (smallest z, within `depth_mm`) fixed, the highest one a handle named
// "top".
ConstraintSet BarEnds(const TetMesh& bar, double depth_mm = 1e-6);

// A mesh under tests/data, "tongue/volumetricTongue.vtu". Aborts when it cannot be read.
TetMesh LoadTestMesh(const std::string& path_under_test_data);

// Absolute path of a file under tests/data.
std::string TestDataPath(const std::string& path_under_test_data);

// Path of a file in the large data sets that lie beside a developer's checkout
// (TISSUEFORM_SHARED_DATA, or
// ../shared/data); empty where they are missing: the caller skips.
std::string SharedDataPath(const std::string& path);

}  // namespace tissueform::testing
