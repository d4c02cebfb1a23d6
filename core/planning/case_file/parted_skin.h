// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/contact_row.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// A head's skin is one piece; a mesh whose lips part is not. Here each triangle of the skin comes
// to follow one lip only: vertices that triangles of both lips have are doubled, the doubles last,
// at the same places, so that nothing is seen at rest. `rows` and `sticking` are of `mesh`, rows
// name its vertices; without doubles at a seam the skin stays as it is.
//
// REQUIRES: skin->follows; `rows` were checked (ConstraintSet::Create).
void PartSkin(const TetMesh& mesh, const ConstraintSet& sticking,
              const std::vector<ContactRow>& rows, CaseSurface* skin);

// The two insides of lips that part, which a skin does not have: the facets of the mesh that lie
// upon each other at rest. Every vertex follows its own of the mesh. None without such facets.
std::optional<CaseSurface> InsidesOfLips(const TetMesh& mesh, const ConstraintSet& sticking,
                                         const std::vector<ContactRow>& rows);

}  // namespace tissueform
