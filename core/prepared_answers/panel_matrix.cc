// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_matrix.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissueform {
namespace {

constexpr int kLanes = PanelMatrix::kPanelRows / 2;

using Digits = PanelMatrix::Digits;

// Under instruction sets with shorter registers the compiler splits them.
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using WholeLanes = int32_t __attribute__((vector_size(kLanes * sizeof(int32_t)), may_alias));

// What is multiplied: panels, factors with the columns' steps in them.
struct Operands {
  const int32_t* upper;
  const int32_t* lower;
  Eigen::Index rows;
  Eigen::Index first;
  Eigen::Index cols;
  const float* factors;  // #cols by 1 or 3, row-major
};

// One column of a panel, its first and its second half of the rows.
struct ColumnLanes {
  Lanes halves[2];
};

// Shifts, because conversions from 16 bits work on shorter registers. The upper half of an entry
// stays where it is in 32 bits: exact as a float.
template <Digits kDigits>
inline __attribute__((always_inline)) void ReadColumn(const Operands& of, Eigen::Index at,
                                                      ColumnLanes* column) {
  const auto pairs = *reinterpret_cast<const WholeLanes*>(of.upper + at * kLanes);
  WholeLanes first = pairs << 16;
  WholeLanes second = pairs & ~0xffff;
  if constexpr (kDigits == Digits::kAll) {
    const auto lower = *reinterpret_cast<const WholeLanes*>(of.lower + at * kLanes);
    first += (lower << 16) >> 16;
    second += lower >> 16;
  }
  column->halves[0] = __builtin_convertvector(first, Lanes);
  column->halves[1] = __builtin_convertvector(second, Lanes);
}

// `rows` rows of kPanels neighbouring panels. Several sums at a time, because one would wait for
// itself.
template <Digits kDigits, int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyPanels(const Operands& of, Eigen::Index panel,
                                                          Eigen::Index rows, float* product) {
  Lanes sums[2 * kPanels][kFactors] = {};
  for (Eigen::Index c = of.first; c < of.cols; ++c) {
    for (int p = 0; p < kPanels; ++p) {
      const Eigen::Index at = (panel + p) * of.cols + c;
      // What comes next: the processor's own look ahead ends at every page of 4 KiB.
      __builtin_prefetch(of.upper + (at + kPanels * of.cols) * kLanes);
      ColumnLanes column;
      ReadColumn<kDigits>(of, at, &column);
      for (int f = 0; f < kFactors; ++f) {
        sums[2 * p][f] += column.halves[0] * of.factors[kFactors * c + f];
        sums[2 * p + 1][f] += column.halves[1] * of.factors[kFactors * c + f];
      }
    }
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (int f = 0; f < kFactors; ++f) {
      product[kFactors * row + f] = sums[row / kLanes][f][row % kLanes];
    }
  }
}

template <Digits kDigits, int kFactors>
inline __attribute__((always_inline)) void MultiplyBody(const Operands& of, float* product) {
  constexpr int kPanels = kFactors == 1 ? 4 : 2;
  constexpr Eigen::Index kRows = PanelMatrix::kPanelRows;
  constexpr Eigen::Index kStep = kPanels * kRows;
  Eigen::Index row = 0;
  for (; row + kStep <= of.rows; row += kStep) {
    MultiplyPanels<kDigits, kFactors, kPanels>(of, row / kRows, kStep, product + kFactors * row);
  }
  for (; row < of.rows; row += kRows) {
    MultiplyPanels<kDigits, kFactors, 1>(of, row / kRows, std::min(kRows, of.rows - row),
                                         product + kFactors * row);
  }
}

using Multiplication = void (*)(const Operands& of, float* product);

template <Digits kDigits, int kFactors>
void MultiplyBaseline(const Operands& of, float* product) {
  MultiplyBody<kDigits, kFactors>(of, product);
}

#if defined(__x86_64__)
template <Digits kDigits, int kFactors>
__attribute__((target("avx512f,avx512dq,avx512vl"))) void MultiplyAvx512(const Operands& of,
                                                                         float* product) {
  MultiplyBody<kDigits, kFactors>(of, product);
}

template <Digits kDigits, int kFactors>
__attribute__((target("avx2,fma"))) void MultiplyAvx2(const Operands& of, float* product) {
  MultiplyBody<kDigits, kFactors>(of, product);
}

template <Digits kDigits, int kFactors>
Multiplication Best() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return MultiplyAvx512<kDigits, kFactors>;
  }
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")
             ? MultiplyAvx2<kDigits, kFactors>
             : MultiplyBaseline<kDigits, kFactors>;
}
#else
template <Digits kDigits, int kFactors>
Multiplication Best() {
  return MultiplyBaseline<kDigits, kFactors>;
}
#endif

// By the number of factors (1 or 3), then by the digits.
const Multiplication kMultiply1[] = {Best<Digits::kUpperHalf, 1>(), Best<Digits::kAll, 1>()};
const Multiplication kMultiply3[] = {Best<Digits::kUpperHalf, 3>(), Best<Digits::kAll, 3>()};

void PutHalf(int64_t half, bool second, int32_t* pair) {
  const auto bits = static_cast<uint32_t>(half & 0xffff);
  const auto others = static_cast<uint32_t>(*pair);
  *pair = static_cast<int32_t>(second ? (others & 0xffffU) | bits << 16
                                      : (others & 0xffff0000U) | bits);
}

Eigen::Index NumPanels(Eigen::Index rows) {
  return (rows + PanelMatrix::kPanelRows - 1) / PanelMatrix::kPanelRows;
}

}  // namespace

PanelMatrix::PanelMatrix(Eigen::Index rows, Eigen::Index cols)
    : rows_(rows),
      cols_(cols),
      steps_(cols, 0.0),
      upper_(NumPanels(rows) * cols),
      lower_(NumPanels(rows) * cols) {}

void PanelMatrix::SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values) {
  // The largest entry's upper half is the largest that there is.
  const double largest = rows_ > 0 ? values.cwiseAbs().maxCoeff() : 0;
  const double step = largest / (double{std::numeric_limits<int16_t>::max()} * kUpper);
  steps_[column] = step;
  for (Eigen::Index row = 0; row < rows_; ++row) {
    const int64_t whole = step > 0 ? std::llround(values[row] / step) : 0;
    // To the nearest, so that the lower half has a sign of its own.
    const int64_t upper = (whole + kUpper / 2) >> 16;
    const Eigen::Index at = row / kPanelRows * cols_ + column;
    const Eigen::Index lane = row % kLanes;
    const bool second = row % kPanelRows >= kLanes;
    PutHalf(upper, second, &upper_[at].pairs[lane]);
    PutHalf(whole - upper * kUpper, second, &lower_[at].pairs[lane]);
  }
}

void PanelMatrix::Multiply(const Eigen::MatrixXd& factors, Eigen::Index first, Digits digits,
                           float* product) const {
  if (upper_.empty()) {
    std::fill_n(product, rows_ * factors.cols(), 0.0F);
    return;
  }
  std::vector<float> scaled;
  scaled.reserve(static_cast<size_t>(factors.size()));
  for (Eigen::Index c = 0; c < cols_; ++c) {
    for (Eigen::Index f = 0; f < factors.cols(); ++f) {
      scaled.push_back(static_cast<float>(factors(c, f) * steps_[c]));
    }
  }
  const Operands of{upper_.front().pairs, lower_.front().pairs, rows_, first, cols_, scaled.data()};
  const Multiplication* multiply = factors.cols() == 1 ? kMultiply1 : kMultiply3;
  multiply[digits == Digits::kUpperHalf ? 0 : 1](of, product);
}

int64_t PanelMatrix::BytesNeeded(Eigen::Index rows, Eigen::Index cols) {
  return 2 * NumPanels(rows) * cols * static_cast<int64_t>(sizeof(Panel));
}

}  // namespace tissueform
