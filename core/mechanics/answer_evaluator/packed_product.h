// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>

namespace tissueform {

// A part of PackedColumns: as many columns of so many rows, of which the last `full` have lower
// halves.
struct PackedPart {
  const double* steps = nullptr;
  const int16_t* upper = nullptr;
  const int16_t* lower = nullptr;
  size_t rows = 0;
  size_t columns = 0;
  size_t full = 0;
};

// sums += columns * factors; `factors` is #columns by `width`, 1 or 3, row-major, `sums` #rows by
// `width`. Columns are added in their order, those that matter least first.
void AddPackedProduct(const PackedPart& part, const double* factors, size_t width, float* sums);
void AddPackedProduct(const PackedPart& part, const double* factors, size_t width, double* sums);

}  // namespace tissueform
