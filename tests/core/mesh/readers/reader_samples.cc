// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/mesh/readers/reader_samples.h"

#include <limits>

namespace tissueform::testing {

RawMesh OneTriangle() {
  RawMesh mesh;
  mesh.positions.resize(3, 3);
  mesh.positions << 0.1, -2, 1e300, 1e-300, 0, 0, 0, 1, std::numeric_limits<double>::infinity();
  mesh.cells.resize(1, 3);
  mesh.cells << 0, 1, 2;
  return mesh;
}

RawMesh TriangleWithArrays() {
  RawMesh mesh = OneTriangle();
  mesh.point_data = {{"bytes", 1, std::vector<int8_t>{-1, 0, 127}},
                     {"unsigned", 1, std::vector<uint64_t>{0, 1, UINT64_MAX}},
                     {"floats", 2, std::vector<float>{1, 2, 3, 4, 5, 6}}};
  mesh.cell_data = {{"doubles", 1, std::vector<double>{0.1}}, {"none", 1, std::vector<int16_t>{}}};
  mesh.split_polygons = 7;
  mesh.left_out_cells = 9;
  return mesh;
}

RawMesh LargerThanAPipe() {
  RawMesh mesh;
  mesh.positions = Positions::NullaryExpr(
      100000, 3, [](Eigen::Index row, Eigen::Index column) { return 0.1 * row + 0.7 * column; });
  mesh.cells.setConstant(200000, 4, 5);
  return mesh;
}

}  // namespace tissueform::testing
