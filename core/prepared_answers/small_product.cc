// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/small_product.h"

#include <cstring>
#include <type_traits>

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

// Under instruction sets with shorter registers the compiler splits them.
constexpr int kBytes = 64;
template <typename Scalar>
constexpr int kLanes = kBytes / static_cast<int>(sizeof(Scalar));
using Doubles = double __attribute__((vector_size(kBytes)));
using Floats = float __attribute__((vector_size(kBytes)));

// From where no alignment is promised.
inline __attribute__((always_inline)) void Load(const double* from, Doubles* lanes) {
  std::memcpy(lanes, from, sizeof(*lanes));
}
inline __attribute__((always_inline)) void Load(const float* from, Floats* lanes) {
  std::memcpy(lanes, from, sizeof(*lanes));
}

// Rows from `row` on, two registers of them, by kCols columns from `col` on.
template <typename Scalar, int kCols>
inline __attribute__((always_inline)) void MultiplyBlock(const Operands<Scalar>& of,
                                                         Eigen::Index row, Eigen::Index col) {
  constexpr int kWide = kLanes<Scalar>;
  using Lanes = std::conditional_t<std::is_same_v<Scalar, double>, Doubles, Floats>;
  Lanes sums[2][kCols] = {};
  Lanes first;
  Lanes second;
  for (Eigen::Index j = 0; j < of.inner; ++j) {
    const Scalar* const a = of.a + j * of.rows + row;
    Load(a, &first);
    Load(a + kWide, &second);
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

template <typename Scalar, int kCols>
inline __attribute__((always_inline)) void MultiplyColumns(const Operands<Scalar>& of,
                                                           Eigen::Index col) {
  constexpr Eigen::Index kRows = 2 * kLanes<Scalar>;
  for (Eigen::Index row = 0; row + kRows <= of.rows; row += kRows) {
    MultiplyBlock<Scalar, kCols>(of, row, col);
  }
  // The last rows once more with those before them: the same numbers.
  if (of.rows % kRows != 0) MultiplyBlock<Scalar, kCols>(of, of.rows - kRows, col);
}

// REQUIRES: at least two registers of rows.
template <typename Scalar>
inline __attribute__((always_inline)) void MultiplyBody(const Operands<Scalar>& of) {
  Eigen::Index col = 0;
  for (; col + 3 <= of.cols; col += 3) MultiplyColumns<Scalar, 3>(of, col);
  for (; col < of.cols; ++col) MultiplyColumns<Scalar, 1>(of, col);
}

template <typename Scalar>
using Multiplication = void (*)(const Operands<Scalar>& of);

template <typename Scalar>
void MultiplyBaseline(const Operands<Scalar>& of) {
  MultiplyBody(of);
}

#if defined(__x86_64__)
template <typename Scalar>
__attribute__((target("avx512f,avx512dq,avx512vl"))) void MultiplyAvx512(
    const Operands<Scalar>& of) {
  MultiplyBody(of);
}

template <typename Scalar>
__attribute__((target("avx2,fma"))) void MultiplyAvx2(const Operands<Scalar>& of) {
  MultiplyBody(of);
}

template <typename Scalar>
Multiplication<Scalar> Best() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return MultiplyAvx512<Scalar>;
  }
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? MultiplyAvx2<Scalar>
                                                                         : MultiplyBaseline<Scalar>;
}
#else
template <typename Scalar>
Multiplication<Scalar> Best() {
  return MultiplyBaseline<Scalar>;
}
#endif

template <typename Scalar>
RowMajorMatrix<Scalar> Multiply(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& a,
                                const RowMajorMatrix<Scalar>& b) {
  if (a.rows() < 2 * kLanes<Scalar>) return a * b;
  static const Multiplication<Scalar> kMultiply = Best<Scalar>();
  RowMajorMatrix<Scalar> product(a.rows(), b.cols());
  kMultiply({a.data(), a.rows(), a.cols(), b.data(), b.cols(), product.data()});
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
