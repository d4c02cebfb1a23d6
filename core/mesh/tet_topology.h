// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Local vertices of the facet opposite to corner k, counter-clockwise seen from outside a positive
// tet.
inline constexpr std::array<std::array<int, 3>, 4> kTetFacets = {
    {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

// Local end points of the six edges of a tet; edge 5 - e is the one opposite to edge e.
inline constexpr std::array<std::array<int, 2>, 6> kTetEdges = {
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

// Vertices joined by cells carry the same number, 0-based, in the order of their smallest vertex.
struct ConnectedComponents {
  static constexpr int32_t kUnreferenced = -1;

  std::vector<int32_t> component_of_vertex;  // #V; kUnreferenced where no cell holds the vertex
  int32_t count = 0;
};
ConnectedComponents FindConnectedComponents(const Eigen::Ref<const CellIndices>& cells,
                                            Eigen::Index num_vertices);

// Facets that belong to exactly one tet, #B by 3, oriented outwards for positive tets, in the order
// of their tets. Facets that three or more tets share are not boundary; ValidateTetMesh reports
// them.
TriangleIndices BoundaryFacets(const TetMesh& mesh);

// Of each of a mesh's BoundaryFacets the tet that has it. REQUIRES: `facets` are those.
std::vector<int32_t> TetsBehind(const TriangleIndices& facets, const TetMesh& mesh);

// The distinct vertices of BoundaryFacets, rising: the "skin" of a mesh.
std::vector<int32_t> BoundaryVertices(const TetMesh& mesh);
// The same where the facets are there already.
std::vector<int32_t> VerticesOf(const TriangleIndices& facets);

}  // namespace tissueform
