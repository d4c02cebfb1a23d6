// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/packed_product.h"

namespace tissueform {
namespace {

constexpr int32_t kUpper = 1 << 16;  // steps in one of the upper half

// One column whose entries `entry` tells. Widths of their own, so that compilers unroll.
template <size_t kWidth, typename Sum, typename Entry>
void AddColumn(size_t rows, const Sum* factors, const Entry& entry, Sum* sums) {
  for (size_t row = 0; row < rows; ++row) {
    const auto value = static_cast<Sum>(entry(row));
    for (size_t f = 0; f < kWidth; ++f) sums[kWidth * row + f] += value * factors[f];
  }
}

template <size_t kWidth, typename Sum>
void AddProduct(const PackedPart& part, const double* factors, Sum* sums) {
  const size_t only_upper = part.columns - part.full;
  for (size_t c = 0; c < part.columns; ++c) {
    Sum scaled[kWidth];
    for (size_t f = 0; f < kWidth; ++f) {
      scaled[f] = static_cast<Sum>(factors[kWidth * c + f] * part.steps[c]);
    }
    const int16_t* const upper = part.upper + c * part.rows;
    if (c < only_upper) {
      AddColumn<kWidth>(
          part.rows, scaled, [=](size_t row) { return int32_t{upper[row]} * kUpper; }, sums);
    } else {
      // In 64 bits: bytes from outside may hold what is no 32-bit number together.
      const int16_t* const lower = part.lower + (c - only_upper) * part.rows;
      AddColumn<kWidth>(
          part.rows, scaled, [=](size_t row) { return int64_t{upper[row]} * kUpper + lower[row]; },
          sums);
    }
  }
}

template <typename Sum>
void AddByWidth(const PackedPart& part, const double* factors, size_t width, Sum* sums) {
  width == 3 ? AddProduct<3>(part, factors, sums) : AddProduct<1>(part, factors, sums);
}

}  // namespace

void AddPackedProduct(const PackedPart& part, const double* factors, size_t width, float* sums) {
  AddByWidth(part, factors, width, sums);
}

void AddPackedProduct(const PackedPart& part, const double* factors, size_t width, double* sums) {
  AddByWidth(part, factors, width, sums);
}

}  // namespace tissueform
