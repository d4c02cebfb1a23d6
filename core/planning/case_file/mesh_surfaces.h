// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/case_file/case_file.h"

namespace tissueform {

// What the tet mesh of a plan itself has to show, for plans beside which nothing better lies.

// The boundary where it is neither bone nor cut: facets with a free vertex. Every vertex follows
// its own one. `region_of_vertex` is #V of the mesh, or empty. Nothing where all vertices are
// constrained.
std::optional<CaseSurface> SkinOfMesh(const TetMesh& mesh, const ConstraintSet& constraints,
                                      const std::vector<uint8_t>& region_of_vertex);

// Facets of the mesh (#F by 3, numbers of its vertices) as a surface whose vertices follow their
// own.
CaseSurface SurfaceOf(std::string name, const TetMesh& mesh, const TriangleIndices& facets);

// Where tissue lies on the bone of each handle, facing out of the bone. A handle without a whole
// facet has none.
std::vector<CaseSurface> SegmentsOfMesh(const TetMesh& mesh, const ConstraintSet& constraints);

}  // namespace tissueform
