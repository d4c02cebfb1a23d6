// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/triangle_mesh.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/index_check.h"

namespace tissueform {

absl::StatusOr<TriangleMesh> TriangleMesh::Create(Positions positions, TriangleIndices triangles) {
  TF_RETURN_IF_ERROR(CheckCellIndices(positions.rows(), triangles, "triangle"));
  return TriangleMesh(
      std::make_shared<const Arrays>(Arrays{std::move(positions), std::move(triangles)}));
}

}  // namespace tissueform
