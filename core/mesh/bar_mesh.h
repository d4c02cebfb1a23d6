// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The planes of a rectilinear grid across x, y and z, in mm: rising, at least two a direction.
// Uneven distances make a graded mesh.
struct GridPlanes {
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> z;
};

// `cells` + 1 planes from `begin_mm` to `end_mm`, both met exactly. REQUIRES: cells >= 1.
std::vector<double> EvenPlanes(double begin_mm, double end_mm, int cells);

// The grid of `cells` cubes of `cell_mm` with its corner at the origin. {10, 10, 20}, {10, 10, 60},
// {15, 25, 30}, {20, 20, 50} and {25, 25, 50} are the bars of Table 1 of Liao et al. 2009.
GridPlanes CubeGrid(const std::array<int, 3>& cells, double cell_mm);

// Bar or block of six positive tets a grid cell, all round the cell's diagonal from its lowest to
// its highest corner, so that neighbours match. With nx, ny cells across x and y, vertex (i, j, k)
// has the number i + (nx + 1) * (j + (ny + 1) * k), and the tets of a cell follow each other in the
// same order of cells.
//
// Errors: InvalidArgument when a direction has fewer than two planes or its planes do not rise, or
// when there are more vertices than a vertex index can name.
absl::StatusOr<TetMesh> BarMesh(const GridPlanes& planes);

}  // namespace tissueform
