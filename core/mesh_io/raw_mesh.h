// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/base/types.h"
#include "core/mesh/attribute.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// What an adaptor has taken out of its library, before anything of it is checked: the vertices that
// a cell names may not exist. Internal to core/mesh_io.
struct RawMesh {
  Positions positions;
  CellIndices cells;                  // #C by 4 (tets) or 3 (triangles)
  std::vector<Attribute> point_data;  // #V tuples each
  std::vector<Attribute> cell_data;   // #C tuples each
  int64_t split_polygons = 0;         // faces with more than three corners that became triangles
};

}  // namespace tissueform
