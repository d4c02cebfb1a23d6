// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_matrix.h"

#include <algorithm>

namespace tissueform {
namespace {

constexpr int kRows = PanelMatrix::kPanelRows;

// One row of a panel's column block. Under instruction sets with shorter registers the compiler
// splits it.
using Lanes = float __attribute__((vector_size(kRows * sizeof(float)), may_alias));

// Rows [0, rows) of kPanels neighbouring panels times `factors` (#cols by kFactors, row-major).
// Several panels at a time, because one would wait for its own sums.
template <int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyPanels(const float* panels, Eigen::Index cols,
                                                          const float* factors, Eigen::Index rows,
                                                          float* product) {
  Lanes sums[kPanels][kFactors] = {};
  for (Eigen::Index c = 0; c < cols; ++c) {
    for (int p = 0; p < kPanels; ++p) {
      const Lanes column = *reinterpret_cast<const Lanes*>(panels + (p * cols + c) * kRows);
      for (int f = 0; f < kFactors; ++f) {
        sums[p][f] += column * factors[kFactors * c + f];
      }
    }
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (int f = 0; f < kFactors; ++f) {
      product[kFactors * row + f] = sums[row / kRows][f][row % kRows];
    }
  }
}

template <int kFactors>
inline __attribute__((always_inline)) void MultiplyBody(const float* panels, Eigen::Index rows,
                                                        Eigen::Index cols, const float* factors,
                                                        float* product) {
  constexpr int kPanels = kFactors == 1 ? 6 : 2;
  constexpr Eigen::Index kStep = kPanels * kRows;
  Eigen::Index row = 0;
  for (; row + kStep <= rows; row += kStep) {
    MultiplyPanels<kFactors, kPanels>(panels + row * cols, cols, factors, kStep,
                                      product + kFactors * row);
  }
  for (; row < rows; row += kRows) {
    MultiplyPanels<kFactors, 1>(panels + row * cols, cols, factors,
                                std::min<Eigen::Index>(kRows, rows - row),
                                product + kFactors * row);
  }
}

using Multiplication = void (*)(const float* panels, Eigen::Index rows, Eigen::Index cols,
                                const float* factors, float* product);

template <int kFactors>
void MultiplyBaseline(const float* panels, Eigen::Index rows, Eigen::Index cols,
                      const float* factors, float* product) {
  MultiplyBody<kFactors>(panels, rows, cols, factors, product);
}

// The same body for other instruction sets. Not target_clones: its resolvers run before the
// sanitizers' set-up.
#if defined(__x86_64__)
template <int kFactors>
__attribute__((target("avx512f,avx512dq,avx512vl"))) void MultiplyAvx512(const float* panels,
                                                                         Eigen::Index rows,
                                                                         Eigen::Index cols,
                                                                         const float* factors,
                                                                         float* product) {
  MultiplyBody<kFactors>(panels, rows, cols, factors, product);
}

template <int kFactors>
__attribute__((target("avx2,fma"))) void MultiplyAvx2(const float* panels, Eigen::Index rows,
                                                      Eigen::Index cols, const float* factors,
                                                      float* product) {
  MultiplyBody<kFactors>(panels, rows, cols, factors, product);
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

Eigen::Index NumPanels(Eigen::Index rows) { return (rows + kRows - 1) / kRows; }

}  // namespace

PanelMatrix::PanelMatrix(Eigen::Index rows, Eigen::Index cols)
    : rows_(rows), cols_(cols), panels_(NumPanels(rows) * cols) {}

void PanelMatrix::SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (Eigen::Index row = 0; row < rows_; ++row) {
    panels_[row / kRows * cols_ + column].rows[row % kRows] = static_cast<float>(values[row]);
  }
}

void PanelMatrix::Multiply(const FloatFactors& factors, float* product) const {
  const float* panels = panels_.empty() ? nullptr : panels_.front().rows;
  (factors.cols() == 1 ? kMultiply1 : kMultiply3)(panels, rows_, cols_, factors.data(), product);
}

int64_t PanelMatrix::BytesNeeded(Eigen::Index rows, Eigen::Index cols) {
  return NumPanels(rows) * cols * static_cast<int64_t>(sizeof(Panel));
}

}  // namespace tissueform
