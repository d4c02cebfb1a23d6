// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/constraints/head_frame.h"

namespace tissueform {

inline constexpr int kIconPixels = 64;  // each way

// A small picture of a surface, from the patient's right and front, row by row from the top: black
// outside the surface, the brighter the more a triangle faces the observer. For lists of models;
// needs no display.
std::vector<uint8_t> DrawModelIcon(const FloatPositions& positions,
                                   const TriangleIndices& triangles, const HeadFrame& frame);

}  // namespace tissueform
