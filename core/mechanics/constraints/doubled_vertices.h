// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/contact_row.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// For every vertex of `positions` (#V by 3) the first one at its place, to the last bit, that rows
// join it with: itself unless it is a double. So a seam between lips is found again.
//
// Errors: InvalidArgument (a row names a vertex that the mesh does not have).
absl::StatusOr<std::vector<int32_t>> FirstAtPlace(const Positions& positions,
                                                  const std::vector<ContactRow>& rows);

}  // namespace tissueform
