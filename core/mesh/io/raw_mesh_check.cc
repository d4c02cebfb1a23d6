// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/raw_mesh_check.h"

#include <set>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/index_check.h"
#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {
namespace {

absl::Status CheckArrays(const std::vector<Attribute>& attributes, Eigen::Index num_tuples) {
  std::set<std::string> names;
  for (const Attribute& attribute : attributes) {
    TF_RETURN_IF_ERROR(CheckAttributeName(attribute.name));
    if (!names.insert(attribute.name).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("it has two arrays named \"", attribute.name, "\""));
    }
    const size_t size =
        std::visit([](const auto& values) { return values.size(); }, attribute.values);
    if (static_cast<int64_t>(size) != int64_t{attribute.components} * num_tuples) {
      return absl::InvalidArgumentError(absl::StrCat("array \"", attribute.name, "\" has ", size,
                                                     " values, not ", attribute.components,
                                                     " times ", num_tuples));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckRawMesh(const RawMesh& mesh) {
  const char* const cell = mesh.cells.cols() == 3 ? "triangle" : "tet";
  TF_RETURN_IF_ERROR(CheckCellIndices(mesh.positions.rows(), mesh.cells, cell));
  TF_RETURN_IF_ERROR(CheckArrays(mesh.point_data, mesh.positions.rows()));
  return CheckArrays(mesh.cell_data, mesh.cells.rows());
}

absl::Status WithMeshName(const std::string& path, const absl::Status& error) {
  return absl::Status(error.code(), absl::StrCat("cannot read mesh ", path, ": ", error.message()));
}

}  // namespace tissueform
