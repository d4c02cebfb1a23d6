// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/small_product.h"

#include <cstring>

#include "core/base/instruction_set.h"

namespace tissueform {
namespace {

template <typename Scalar>
struct Operands {
  const Scalar* a;  // column-major
  Eigen::Index rows;
  Eigen::Index inner;
  const Scalar* b;  // row-major
  Eigen::Index cols;
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
inline __attribute__((always_inline)) void MultiplyBlock(const Operands<Scalar>& of,
                                                         Eigen::Index row, Eigen::Index col) {
  constexpr int kWide = Register<Scalar, kSet>::kLanes;
  using Lanes = typename Register<Scalar, kSet>::Lanes;
  Lanes sums[2][kCols] = {};
  Lanes first;
  Lanes second;
  for (Eigen::Index j = 0; j < of.inner; ++j) {
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
inline __attribute__((always_inline)) void MultiplyColumns(const Operands<Scalar>& of,
                                                           Eigen::Index col) {
  constexpr Eigen::Index kRows = 2 * Register<Scalar, kSet>::kLanes;
  for (Eigen::Index row = 0; row + kRows <= of.rows; row += kRows) {
    MultiplyBlock<Scalar, kSet, kCols>(of, row, col);
  }
  // The last rows once more with those before them: the same numbers.
  if (of.rows % kRows != 0) MultiplyBlock<Scalar, kSet, kCols>(of, of.rows - kRows, col);
}

// REQUIRES: at least two registers of rows.
template <typename Scalar, InstructionSet kSet>
inline __attribute__((always_inline)) void MultiplyBody(const Operands<Scalar>& of) {
  Eigen::Index col = 0;
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

template <typename Scalar>
RowMajorMatrix<Scalar> Multiply(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& a,
                                const RowMajorMatrix<Scalar>& b) {
  // Two of the widest registers, so that which path a matrix takes does not depend on the
  // processor.
  constexpr int kFewestRows = 2 * Register<Scalar, InstructionSet::kAvx512>::kLanes;
  if (a.rows() < kFewestRows) return a * b;
  RowMajorMatrix<Scalar> product(a.rows(), b.cols());
  kMultiply<Scalar>.Active()({a.data(), a.rows(), a.cols(), b.data(), b.cols(), product.data()});
  return product;
}

}  // namespace

RowMajorMatrix<double> MultiplySmall(const Eigen::MatrixXd& a, const RowMajorMatrix<double>& b) {
  return Multiply<double>(a, b);
}

RowMajorMatrix<float> MultiplySmall(const Eigen::MatrixXf& a, const RowMajorMatrix<float>& b) {
  return Multiply<float>(a, b);
}

}  // namespace tissueform
