// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/packed_matrix.h"

#include <algorithm>
#include <vector>

namespace tissueform {
namespace {

// Rows that are summed at a time: their sums fit into the first-level cache for columns of any
// length.
constexpr size_t kRowsAtOnce = 1024;
constexpr int32_t kUpper = 1 << 16;  // steps in one of the upper half

// One column whose entries `entry` gives, added to a plane of sums for each factor: compilers
// vectorize what lies one behind the other.
template <size_t kWidth, typename Entry>
void AddColumn(size_t rows, const float* factors, const Entry& entry,
               float (&planes)[kWidth][kRowsAtOnce]) {
  for (size_t row = 0; row < rows; ++row) {
    const auto value = static_cast<float>(entry(row));
    for (size_t f = 0; f < kWidth; ++f) planes[f][row] += value * factors[f];
  }
}

// Rows `first` to `first` + `rows` of the columns that are read; `scaled` holds each column's
// factors times its step.
template <size_t kWidth>
void MultiplyRows(const PackedPart& part, const ColumnReading& reading, const float* scaled,
                  size_t first, size_t rows, float* product) {
  float planes[kWidth][kRowsAtOnce] = {};
  const size_t only_upper = part.columns - part.full;
  for (size_t c = reading.first; c < part.columns; ++c) {
    const int16_t* const upper = part.upper + c * part.rows + first;
    const float* const factors = scaled + kWidth * c;
    if (c < reading.first_full) {
      const auto entry = [=](size_t row) { return int32_t{upper[row]} * kUpper; };
      AddColumn<kWidth>(rows, factors, entry, planes);
    } else {
      // As a double, which vectorizes: bytes from outside may hold what is no 32-bit number
      // together.
      const int16_t* const lower = part.lower + (c - only_upper) * part.rows + first;
      const auto entry = [=](size_t row) {
        return double{upper[row] * double{kUpper}} + lower[row];
      };
      AddColumn<kWidth>(rows, factors, entry, planes);
    }
  }
  for (size_t row = 0; row < rows; ++row) {
    for (size_t f = 0; f < kWidth; ++f) product[kWidth * (first + row) + f] = planes[f][row];
  }
}

template <size_t kWidth>
void MultiplyAll(const PackedPart& part, const double* factors, const ColumnReading& reading,
                 float* product) {
  std::vector<float> scaled(kWidth * part.columns);
  for (size_t i = 0; i < scaled.size(); ++i) {
    scaled[i] = static_cast<float>(factors[i] * part.steps[i / kWidth]);
  }
  for (size_t first = 0; first < part.rows; first += kRowsAtOnce) {
    MultiplyRows<kWidth>(part, reading, scaled.data(), first,
                         std::min(kRowsAtOnce, part.rows - first), product);
  }
}

}  // namespace

void PackedMatrix::Multiply(const double* factors, size_t width, const ColumnReading& reading,
                            float* product) const {
  width == 3 ? MultiplyAll<3>(part_, factors, reading, product)
             : MultiplyAll<1>(part_, factors, reading, product);
}

void PackedMatrix::MultiplyRow(size_t row, const double* factors, size_t width,
                               float* product) const {
  const size_t only_upper = part_.columns - part_.full;
  std::fill_n(product, width, 0.0F);
  for (size_t c = 0; c < part_.columns; ++c) {
    double entry = part_.upper[c * part_.rows + row] * double{kUpper};
    if (c >= only_upper) entry += part_.lower[(c - only_upper) * part_.rows + row];
    for (size_t f = 0; f < width; ++f) {
      product[f] +=
          static_cast<float>(entry) * static_cast<float>(factors[width * c + f] * part_.steps[c]);
    }
  }
}

}  // namespace tissueform
