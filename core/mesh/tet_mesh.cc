// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_mesh.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/index_check.h"

namespace tissueform {

absl::StatusOr<TetMesh> TetMesh::Create(Positions positions, TetIndices tets) {
  TF_RETURN_IF_ERROR(CheckCellIndices(positions.rows(), tets, "tet"));
  return TetMesh(std::make_shared<const Arrays>(Arrays{std::move(positions), std::move(tets)}));
}

double TetMesh::BoundingBoxDiagonal() const {
  return (positions().colwise().maxCoeff() - positions().colwise().minCoeff()).norm();
}

}  // namespace tissueform
