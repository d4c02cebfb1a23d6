// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_matrix.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tissueform {
namespace {

constexpr int kLanes = PanelMatrix::kPanelRows / 2;

// Under instruction sets with shorter registers the compiler splits them.
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
using WholeLanes = int32_t __attribute__((vector_size(kLanes * sizeof(int32_t)), may_alias));

// What is multiplied: panels, factors with the columns' steps in them.
struct Operands {
  const int32_t* upper;
  const int32_t* lower;
  Eigen::Index rows;
  Eigen::Index cols;
  Eigen::Index full_cols;
  PanelMatrix::Reading reading;
  const float* factors;  // #cols by 1 or 3, row-major
};

// One column of a panel, its first and its second half of the rows.
struct ColumnLanes {
  Lanes halves[2];
};

// Shifts, because conversions from 16 bits work on shorter registers. The upper half of an entry
// stays where it is in 32 bits: exact as a float. `lower` may be null.
inline __attribute__((always_inline)) void ReadColumn(const int32_t* upper, const int32_t* lower,
                                                      ColumnLanes* column) {
  const auto pairs = *reinterpret_cast<const WholeLanes*>(upper);
  WholeLanes first = pairs << 16;
  WholeLanes second = pairs & ~0xffff;
  if (lower != nullptr) {
    const auto lower_pairs = *reinterpret_cast<const WholeLanes*>(lower);
    first += (lower_pairs << 16) >> 16;
    second += lower_pairs >> 16;
  }
  column->halves[0] = __builtin_convertvector(first, Lanes);
  column->halves[1] = __builtin_convertvector(second, Lanes);
}

template <int kFactors, int kPanels>
inline __attribute__((always_inline)) void AddColumn(const ColumnLanes& column,
                                                     const float* factors, int panel,
                                                     Lanes (*sums)[kFactors]) {
  for (int f = 0; f < kFactors; ++f) {
    sums[2 * panel][f] += column.halves[0] * factors[f];
    sums[2 * panel + 1][f] += column.halves[1] * factors[f];
  }
}

// `rows` rows of kPanels neighbouring panels. Several sums at a time, because one would wait for
// itself.
template <int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyPanels(const Operands& of, Eigen::Index panel,
                                                          Eigen::Index rows, float* product) {
  Lanes sums[2 * kPanels][kFactors] = {};
  ColumnLanes column;
  const int32_t* const upper = of.upper + panel * of.cols * kLanes;
  // What comes next: the processor's own look ahead ends at every page of 4 KiB.
  const Eigen::Index ahead = kPanels * of.cols * kLanes;
  for (Eigen::Index c = of.reading.first; c < of.reading.first_full; ++c) {
    for (int p = 0; p < kPanels; ++p) {
      const int32_t* const at = upper + (p * of.cols + c) * kLanes;
      __builtin_prefetch(at + ahead);
      ReadColumn(at, nullptr, &column);
      AddColumn<kFactors, kPanels>(column, of.factors + kFactors * c, p, sums);
    }
  }
  const int32_t* const lower = of.lower + panel * of.full_cols * kLanes;
  const Eigen::Index only_upper = of.cols - of.full_cols;
  for (Eigen::Index c = of.reading.first_full; c < of.cols; ++c) {
    for (int p = 0; p < kPanels; ++p) {
      const int32_t* const at = upper + (p * of.cols + c) * kLanes;
      __builtin_prefetch(at + ahead);
      ReadColumn(at, lower + (p * of.full_cols + c - only_upper) * kLanes, &column);
      AddColumn<kFactors, kPanels>(column, of.factors + kFactors * c, p, sums);
    }
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (int f = 0; f < kFactors; ++f) {
      product[kFactors * row + f] = sums[row / kLanes][f][row % kLanes];
    }
  }
}

template <int kFactors>
inline __attribute__((always_inline)) void MultiplyBody(const Operands& of, float* product) {
  constexpr int kPanels = kFactors == 1 ? 4 : 2;
  constexpr Eigen::Index kRows = PanelMatrix::kPanelRows;
  constexpr Eigen::Index kStep = kPanels * kRows;
  Eigen::Index row = 0;
  for (; row + kStep <= of.rows; row += kStep) {
    MultiplyPanels<kFactors, kPanels>(of, row / kRows, kStep, product + kFactors * row);
  }
  for (; row < of.rows; row += kRows) {
    MultiplyPanels<kFactors, 1>(of, row / kRows, std::min(kRows, of.rows - row),
                                product + kFactors * row);
  }
}

using Multiplication = void (*)(const Operands& of, float* product);

template <int kFactors>
void MultiplyBaseline(const Operands& of, float* product) {
  MultiplyBody<kFactors>(of, product);
}

#if defined(__x86_64__)
template <int kFactors>
__attribute__((target("avx512f,avx512dq,avx512vl"))) void MultiplyAvx512(const Operands& of,
                                                                         float* product) {
  MultiplyBody<kFactors>(of, product);
}

template <int kFactors>
__attribute__((target("avx2,fma"))) void MultiplyAvx2(const Operands& of, float* product) {
  MultiplyBody<kFactors>(of, product);
}

template <int kFactors>
Multiplication Best() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return MultiplyAvx512<kFactors>;
  }
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")
             ? MultiplyAvx2<kFactors>
             : MultiplyBaseline<kFactors>;
}
#else
template <int kFactors>
Multiplication Best() {
  return MultiplyBaseline<kFactors>;
}
#endif

const Multiplication kMultiply1 = Best<1>();
const Multiplication kMultiply3 = Best<3>();

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

PanelMatrix::PanelMatrix(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols)
    : rows_(rows),
      cols_(cols),
      full_cols_(full_cols),
      steps_(cols, 0.0),
      upper_(NumPanels(rows) * cols),
      lower_(NumPanels(rows) * full_cols) {}

// The largest entry's upper half is the largest that there is.
double PanelMatrix::UpperStepOf(double largest) {
  return largest / double{std::numeric_limits<int16_t>::max()};
}

void PanelMatrix::SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values) {
  const double step = UpperStepOf(rows_ > 0 ? values.cwiseAbs().maxCoeff() : 0) / kUpper;
  steps_[column] = step;
  const Eigen::Index full_column = column - (cols_ - full_cols_);  // negative: none
  for (Eigen::Index row = 0; row < rows_; ++row) {
    const int64_t whole = step > 0 ? std::llround(values[row] / step) : 0;
    // To the nearest, so that the lower half has a sign of its own.
    const int64_t upper = (whole + kUpper / 2) >> 16;
    const Eigen::Index panel = row / kPanelRows;
    const Eigen::Index lane = row % kLanes;
    const bool second = row % kPanelRows >= kLanes;
    PutHalf(upper, second, &upper_[panel * cols_ + column].pairs[lane]);
    if (full_column >= 0) {
      PutHalf(whole - upper * kUpper, second,
              &lower_[panel * full_cols_ + full_column].pairs[lane]);
    }
  }
}

void PanelMatrix::Multiply(const Eigen::MatrixXd& factors, const Reading& reading,
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
  const int32_t* const lower = lower_.empty() ? nullptr : lower_.front().pairs;
  const Operands of{upper_.front().pairs, lower, rows_, cols_, full_cols_, reading, scaled.data()};
  (factors.cols() == 1 ? kMultiply1 : kMultiply3)(of, product);
}

void PanelMatrix::Describe(PackedColumns* packed) const {
  packed->steps.insert(packed->steps.end(), steps_.begin(), steps_.end());
  const auto append = [this](const std::vector<Panel>& panels, Eigen::Index cols,
                             std::vector<int16_t>* halves) {
    for (Eigen::Index c = 0; c < cols; ++c) {
      for (Eigen::Index row = 0; row < rows_; ++row) {
        const int32_t pair = panels[row / kPanelRows * cols + c].pairs[row % kLanes];
        halves->push_back(
            static_cast<int16_t>(row % kPanelRows < kLanes ? pair & 0xffff : pair >> 16));
      }
    }
  };
  append(upper_, cols_, &packed->upper);
  append(lower_, full_cols_, &packed->lower);
}

int64_t PanelMatrix::BytesNeeded(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols) {
  return NumPanels(rows) * (cols + full_cols) * static_cast<int64_t>(sizeof(Panel));
}

}  // namespace tissueform
