// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/constraint_set.h"

namespace tissueform {

// Writes how many vertices and handles there are, regions, and the rest of all vertices of an
// answer. `rest`: of all vertices of the mesh, #V by 3, mm. A vertex may come more than once.
// Returns those of `vertices` that are free, in their order. REQUIRES: `vertices` in [0, #V).
std::vector<int32_t> DescribeVertices(const Positions& rest, const ConstraintSet& constraints,
                                      const std::vector<int32_t>& vertices,
                                      PortableAnswers* answers);

}  // namespace tissueform
