// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/tetgen_reader.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <tetgen.h>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh_io/isolated_read.h"
#include "core/mesh_io/plain_names.h"

namespace tissueform {
namespace {

constexpr char kPlainName[] = "mesh";

// TetGen passes over rows beyond those that the first line announces, and does not always notice
// that one is missing.
absl::Status CheckRowCount(const std::string& path) {
  std::ifstream stream(path);
  int64_t announced = -1;
  int64_t rows = 0;
  for (std::string line; std::getline(stream, line);) {
    const absl::string_view text = absl::StripAsciiWhitespace(line);
    if (text.empty() || absl::StartsWith(text, "#")) continue;
    if (announced >= 0) {
      ++rows;
    } else if (!absl::SimpleAtoi(text.substr(0, text.find_first_of(" \t,")), &announced) ||
               announced < 0) {
      return absl::InvalidArgumentError("its first line does not begin with a count");
    }
  }
  if (rows == announced) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the first line of ", std::filesystem::path(path).extension().string(), " announces ",
      announced, " rows, ", rows, " follow; it is truncated or damaged"));
}

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

absl::StatusOr<RawMesh> ReadWithTetgen(const std::string& base) {
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

}  // namespace

absl::StatusOr<RawMesh> ReadTetgen(const CheckedMeshFile& file, const MeshReadLimits& limits) {
  TF_ASSIGN_OR_RETURN(const PlainNames names, PlainNames::Create());
  for (const std::string& path : {file.path, TetgenPartner(file.path)}) {
    TF_RETURN_IF_ERROR(CheckRowCount(path));
    const std::string ending =
        absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
    TF_RETURN_IF_ERROR(names.Link(path, kPlainName + ending));
  }
  return ReadIsolated(limits, [&names] { return ReadWithTetgen(names.Path(kPlainName)); });
}

}  // namespace tissueform
