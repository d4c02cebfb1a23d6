// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "absl/types/span.h"

#include "core/base/types.h"

namespace tissueform {

// An edge as one triangle has it.
struct HalfEdge {
  std::array<int32_t, 2> edge;  // its vertices, rising
  bool runs_up;                 // from the lower to the higher vertex
  int32_t triangle;
};

// The half-edges of one edge of a surface, in the order of their triangles.
using EdgeUses = absl::Span<const HalfEdge>;

// Open: an edge of one triangle. Non-manifold: of three or more. Turned: both its triangles run
// through it the same way, so one of them faces the other side.
inline bool IsOpen(EdgeUses uses) { return uses.size() == 1; }
inline bool IsNonManifold(EdgeUses uses) { return uses.size() > 2; }
inline bool IsTurned(EdgeUses uses) {
  return uses.size() == 2 && uses[0].runs_up == uses[1].runs_up;
}

// Calls `visit` once for every edge, in the order of their vertices.
//
// REQUIRES: fewer than 2^31 triangles.
void ForEachEdge(const TriangleIndices& triangles, const std::function<void(EdgeUses)>& visit);

}  // namespace tissueform
