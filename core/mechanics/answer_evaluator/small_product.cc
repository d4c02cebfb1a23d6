// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/small_product.h"

#include <algorithm>
#include <cstring>

#include "core/base/instruction_set.h"

namespace tissueform {
namespace {

template <typename Scalar>
struct Operands {
  const Scalar* a;  // column-major
  size_t rows;
  size_t inner;
  const Scalar* b;  // row-major
  size_t cols;
  Scalar* product;  // row-major
};

// A vector register of an instruction set.
template <typename Scalar, InstructionSet kSet>
struct Register {
  static constexpr int kLanes = RegisterBytes(kSet) / static_cast<int>(sizeof(Scalar));
  using Lanes [[gnu::vector_size(RegisterBytes(kSet))]] = Scalar;
};

// Rows from `row` on, two registers of them, by kCols columns from `col` on.
template <typename Scalar, InstructionSet kSet, int kCols>
inline __attribute__((always_inline)) void MultiplyBlock(const Operands<Scalar>& of, size_t row,
                                                         size_t col) {
  constexpr int kWide = Register<Scalar, kSet>::kLanes;
  using Lanes = typename Register<Scalar, kSet>::Lanes;
  Lanes sums[2][kCols] = {};
  Lanes first;
  Lanes second;
  for (size_t j = 0; j < of.inner; ++j) {
    // Copied bytewise, because `a` need not be aligned to a register.
    const Scalar* const a = of.a + j * of.rows + row;
    std::memcpy(&first, a, sizeof(first));
    std::memcpy(&second, a + kWide, sizeof(second));
    const Scalar* const b = of.b + j * of.cols + col;
    for (int f = 0; f < kCols; ++f) {
      sums[0][f] += first * b[f];
      sums[1][f] += second * b[f];
    }
  }
  for (int half = 0; half < 2; ++half) {
    for (int lane = 0; lane < kWide; ++lane) {
      for (int f = 0; f < kCols; ++f) {
        of.product[(row + half * kWide + lane) * of.cols + col + f] = sums[half][f][lane];
      }
    }
  }
}

template <typename Scalar, InstructionSet kSet, int kCols>
inline __attribute__((always_inline)) void MultiplyColumns(const Operands<Scalar>& of, size_t col) {
  constexpr size_t kRows = 2 * Register<Scalar, kSet>::kLanes;
  for (size_t row = 0; row + kRows <= of.rows; row += kRows) {
    MultiplyBlock<Scalar, kSet, kCols>(of, row, col);
  }
  // The last rows once more with those before them: the same numbers.
  if (of.rows % kRows != 0) MultiplyBlock<Scalar, kSet, kCols>(of, of.rows - kRows, col);
}

// REQUIRES: at least two registers of rows.
template <typename Scalar, InstructionSet kSet>
inline __attribute__((always_inline)) void MultiplyBody(const Operands<Scalar>& of) {
  size_t col = 0;
  for (; col + 3 <= of.cols; col += 3) MultiplyColumns<Scalar, kSet, 3>(of, col);
  for (; col < of.cols; ++col) MultiplyColumns<Scalar, kSet, 1>(of, col);
}

template <typename Scalar>
void MultiplyBaseline(const Operands<Scalar>& of) {
  MultiplyBody<Scalar, InstructionSet::kBaseline>(of);
}

template <typename Scalar>
TISSUEFORM_TARGET_AVX2 void MultiplyAvx2(const Operands<Scalar>& of) {
  MultiplyBody<Scalar, InstructionSet::kAvx2>(of);
}

template <typename Scalar>
TISSUEFORM_TARGET_AVX512 void MultiplyAvx512(const Operands<Scalar>& of) {
  MultiplyBody<Scalar, InstructionSet::kAvx512>(of);
}

template <typename Scalar>
constexpr KernelVersions<void(const Operands<Scalar>&)> kMultiply{
    MultiplyBaseline<Scalar>, MultiplyAvx2<Scalar>, MultiplyAvx512<Scalar>};

// For few rows, column by column of `a`.
template <typename Scalar>
void MultiplyFewRows(const Operands<Scalar>& of) {
  std::fill_n(of.product, of.rows * of.cols, Scalar{0});
  for (size_t j = 0; j < of.inner; ++j) {
    for (size_t row = 0; row < of.rows; ++row) {
      for (size_t f = 0; f < of.cols; ++f) {
        of.product[row * of.cols + f] += of.a[j * of.rows + row] * of.b[j * of.cols + f];
      }
    }
  }
}

template <typename Scalar>
void Multiply(const Operands<Scalar>& of) {
  // Two of the widest registers, so that which path a matrix takes does not depend on the
  // processor.
  constexpr size_t kFewestRows = 2 * Register<Scalar, InstructionSet::kAvx512>::kLanes;
  if (of.rows < kFewestRows) return MultiplyFewRows(of);
  kMultiply<Scalar>.Active()(of);
}

}  // namespace

void MultiplySmall(const double* a, const double* b, const SmallSizes& sizes, double* product) {
  Multiply<double>({a, sizes.rows, sizes.inner, b, sizes.cols, product});
}

void MultiplySmall(const float* a, const float* b, const SmallSizes& sizes, float* product) {
  Multiply<float>({a, sizes.rows, sizes.inner, b, sizes.cols, product});
}

}  // namespace tissueform
