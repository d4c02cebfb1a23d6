// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>

namespace tissueform {

// product = a * b for matrices of tens to hundreds of rows and a few columns b: what finds the
// coefficients of a pose, between a frame and the next. `a` is column-major, #rows by #inner; `b`
// and `product` are row-major, #inner by #cols and #rows by #cols. Compiled for several instruction
// sets: what a compiler makes of it for every processor takes four times as long.
struct SmallSizes {
  size_t rows = 0;
  size_t inner = 0;
  size_t cols = 0;
};
void MultiplySmall(const double* a, const double* b, const SmallSizes& sizes, double* product);
void MultiplySmall(const float* a, const float* b, const SmallSizes& sizes, float* product);

}  // namespace tissueform
