// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/contact_row.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {

// The mesh with its lips in one piece, as if they had never been parted. The doubles of a seam are
// the last vertices; each is at the same place, to the last bit, as an earlier vertex with which it
// has a contact row. They are removed: tets get the earlier vertex, point arrays end before them. A
// mesh without doubles stays as it is.
//
// Errors: InvalidArgument (a row names a vertex that the mesh does not have; doubles that are not
// the last vertices; a tet with both lips' vertices at one place).
absl::StatusOr<TetMeshFile> WeldSeam(TetMeshFile file, const std::vector<ContactRow>& rows);

}  // namespace tissueform
