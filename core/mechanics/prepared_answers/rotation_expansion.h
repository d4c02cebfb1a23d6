// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/prepared_answers/simplex_polynomials.h"

namespace tissueform {

// Writes degree, nodes, interpolation and the simplex, by which ExpandRotation makes the propagated
// rotation field a polynomial of the harmonic values.
void DescribeExpansion(const SimplexDomain& domain, const SimplexPolynomials& polynomials,
                       PortableAnswers* answers);

// At most.
int64_t RotationExpansionBytes(int dimension, int degree);

}  // namespace tissueform
