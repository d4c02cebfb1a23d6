// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <set>

#include "core/base/types.h"

namespace tissueform::testing {

// The corners of triangles without regard to which comes first, in a triangle or among them.
inline std::set<std::array<int32_t, 3>> Corners(const TriangleIndices& triangles) {
  std::set<std::array<int32_t, 3>> corners;
  for (const auto& t : triangles.rowwise()) {
    std::array<int32_t, 3> sorted = {t[0], t[1], t[2]};
    std::sort(sorted.begin(), sorted.end());
    corners.insert(sorted);
  }
  return corners;
}

}  // namespace tissueform::testing
