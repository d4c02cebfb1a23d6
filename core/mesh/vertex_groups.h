// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/base/types.h"

namespace tissueform {

// For every vertex the lowest one at exactly the same place, which may be the vertex itself. #V.
//
// REQUIRES: positions are finite.
std::vector<int32_t> FirstVertexAtSamePlace(const Positions& positions);

// The vertices that are not first at their place, rising.
std::vector<Eigen::Index> DuplicateVertices(const std::vector<int32_t>& first_at_place);

// The vertices that no cell holds, rising; `component_of_vertex` as in ConnectedComponents.
std::vector<Eigen::Index> UnreferencedVertices(const std::vector<int32_t>& component_of_vertex);

// The lowest vertex of every component.
std::vector<Eigen::Index> FirstVertexOfComponents(const std::vector<int32_t>& component_of_vertex,
                                                  int32_t count);

}  // namespace tissueform
