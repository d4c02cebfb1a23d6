// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/base/types.h"

namespace tissueform {

// Volume inside a closed surface, mm^3: positive when its triangles are seen counter-clockwise from
// outside.
double EnclosedVolume(const Positions& positions, const TriangleIndices& triangles);

// Areas, mm^2, of the cross-sections of a closed surface by the planes z = height. Exact for the
// piecewise-linear surface; parts that overlap count as often as they overlap.
std::vector<double> SectionAreas(const Positions& positions, const TriangleIndices& triangles,
                                 const std::vector<double>& heights_mm);

// Number of pairs of triangles without a common vertex that intersect. Touching counts, except
// between triangles that have an edge or a vertex in common.
Eigen::Index CountSelfIntersections(const Positions& positions, const TriangleIndices& triangles);

}  // namespace tissueform
