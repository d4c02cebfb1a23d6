// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

enum class MeshFormat { kVtu, kLegacyVtk, kGmsh, kMedit, kTetgen, kStl, kPly, kObj, kOff, kVtp };

// A file that may be given to a library.
struct CheckedMeshFile {
  std::string path;
  MeshFormat format = MeshFormat::kVtu;
  int64_t bytes = 0;
};

// What an adaptor has taken out of its library, before anything of it is checked: the vertices that
// a cell names may not exist.
struct RawMesh {
  Positions positions;
  CellIndices cells;                  // #C by 4 (tets) or 3 (triangles)
  std::vector<Attribute> point_data;  // #V tuples each
  std::vector<Attribute> cell_data;   // #C tuples each
  int64_t split_polygons = 0;         // faces with more than three corners that became triangles
  int64_t left_out_cells = 0;         // points, lines and faces beside the tets
};

// OK for a name that every reader of the file format takes: 1 to 256 bytes, no control characters.
// Otherwise InvalidArgument.
absl::Status CheckAttributeName(absl::string_view name);

}  // namespace tissueform
