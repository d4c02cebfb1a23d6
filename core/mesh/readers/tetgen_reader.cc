// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/tetgen_reader.h"

#include <tetgen.h>
#include <vector>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

// Column `column` of rows of `width` numbers.
Attribute Column(const std::string& name, const double* values, int rows, int width, int column) {
  std::vector<double> picked(static_cast<size_t>(rows));
  for (int row = 0; row < rows; ++row) picked[row] = values[size_t(row) * width + column];
  return {name, 1, std::move(picked)};
}

std::vector<Attribute> Columns(const double* values, int rows, int width) {
  std::vector<Attribute> attributes;
  for (int c = 0; c < width && values != nullptr; ++c) {
    attributes.push_back(Column(absl::StrCat("tetgen_attribute_", c + 1), values, rows, width, c));
  }
  return attributes;
}

void CopyGeometry(const tetgenio& io, RawMesh* mesh) {
  mesh->positions = Eigen::Map<const Positions>(io.pointlist, io.numberofpoints, 3);
  mesh->cells = Eigen::Map<const CellIndices>(io.tetrahedronlist, io.numberoftetrahedra, 4);
  mesh->cells.array() -= io.firstnumber;
}

}  // namespace

absl::StatusOr<RawMesh> ReadTetgen(const std::string& base) {
  std::string name = base;
  tetgenio io;
  if (!io.load_tetmesh(name.data(), tetgenbehavior::MESH)) {
    return absl::InvalidArgumentError("it is damaged: TetGen cannot read the pair of files");
  }
  if (io.pointlist == nullptr || io.tetrahedronlist == nullptr) {
    return absl::InvalidArgumentError("it holds no vertices or no tets");
  }
  if (io.numberofcorners != 4) {
    return absl::InvalidArgumentError(absl::StrCat("its tets have ", io.numberofcorners,
                                                   " corners; only linear tetrahedra are taken"));
  }
  RawMesh mesh;
  CopyGeometry(io, &mesh);
  mesh.point_data = Columns(io.pointattributelist, io.numberofpoints, io.numberofpointattributes);
  if (io.pointmarkerlist != nullptr) {
    mesh.point_data.push_back(
        {"tetgen_marker", 1,
         std::vector<int32_t>(io.pointmarkerlist, io.pointmarkerlist + io.numberofpoints)});
  }
  mesh.cell_data =
      Columns(io.tetrahedronattributelist, io.numberoftetrahedra, io.numberoftetrahedronattributes);
  if (mesh.cell_data.size() == 1) mesh.cell_data.front().name = "tetgen_region";
  return mesh;
}

}  // namespace tissueform
