// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/quantized_matrix.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/instruction_set.h"

namespace tissueform {
namespace {

constexpr int kPairs = QuantizedMatrix::kPanelRows / 2;

// Vector registers of an instruction set.
template <InstructionSet kSet>
struct Register {
  static constexpr int kLanes = RegisterBytes(kSet) / static_cast<int>(sizeof(float));
  static constexpr int kInPanel = kPairs / kLanes;  // registers of pairs in a column of a panel
  using Floats [[gnu::vector_size(RegisterBytes(kSet))]] = float;
  using Pairs [[gnu::vector_size(RegisterBytes(kSet)), gnu::may_alias]] = int32_t;
};

// What is multiplied: panels, factors with the columns' steps in them.
struct Operands {
  const int32_t* upper;
  const int32_t* lower;
  Eigen::Index rows;
  Eigen::Index cols;
  Eigen::Index full_cols;
  QuantizedMatrix::EvaluationPlan reading;
  const float* factors;  // #cols by 1 or 3, row-major
};

// A block of the matrix whose sums stay in registers: all rows of kPanels panels that the registers
// of pairs number `first_register` and up hold, kRegisters of them in each panel. Several sums at a
// time, because one would wait for itself; no more than fit beside what is added.
template <InstructionSet kSet, int kFactors>
struct Block {
  static constexpr bool kIsWide = kSet == InstructionSet::kAvx512;  // 32 registers, not 16
  static constexpr int kPanels = !kIsWide ? 1 : kFactors == 1 ? 4 : 2;
  static constexpr int kRegisters = kFactors == 1 ? Register<kSet>::kInPanel : 1;
  using Sums = typename Register<kSet>::Floats[2][kFactors];  // of upper and of lower rows
};

// Adds one register of pairs of a column. Shifts, because conversions from 16 bits work on shorter
// registers. The upper half of an entry stays where it is in 32 bits: exact as a float. `lower` may
// be null.
template <InstructionSet kSet, int kFactors>
inline __attribute__((always_inline)) void AddPairs(const int32_t* upper, const int32_t* lower,
                                                    const float* factors,
                                                    typename Block<kSet, kFactors>::Sums& sums) {
  using Pairs = typename Register<kSet>::Pairs;
  using Floats = typename Register<kSet>::Floats;
  const auto pairs = *reinterpret_cast<const Pairs*>(upper);
  Pairs first = pairs << 16;
  Pairs second = pairs & ~0xffff;
  if (lower != nullptr) {
    const auto lower_pairs = *reinterpret_cast<const Pairs*>(lower);
    first += (lower_pairs << 16) >> 16;
    second += lower_pairs >> 16;
  }
  const Floats first_rows = __builtin_convertvector(first, Floats);
  const Floats second_rows = __builtin_convertvector(second, Floats);
  for (int f = 0; f < kFactors; ++f) {
    sums[0][f] += first_rows * factors[f];
    sums[1][f] += second_rows * factors[f];
  }
}

// Adds columns begin to end of kPanels panels from `panel` on, with all digits where kIsFull.
template <InstructionSet kSet, int kFactors, int kPanels, bool kIsFull>
inline __attribute__((always_inline)) void AddColumns(
    const Operands& of, Eigen::Index panel, int first_register, Eigen::Index begin,
    Eigen::Index end,
    typename Block<kSet, kFactors>::Sums (&sums)[kPanels][Block<kSet, kFactors>::kRegisters]) {
  constexpr int kLanes = Register<kSet>::kLanes;
  const int32_t* const upper = of.upper + panel * of.cols * kPairs + first_register * kLanes;
  const int32_t* const lower = of.lower + panel * of.full_cols * kPairs + first_register * kLanes;
  const Eigen::Index only_upper = of.cols - of.full_cols;
  // What comes next: the processor's own look ahead ends at every page of 4 KiB.
  const Eigen::Index ahead = kPanels * of.cols * kPairs;
  for (Eigen::Index c = begin; c < end; ++c) {
    for (int p = 0; p < kPanels; ++p) {
      const int32_t* const at = upper + (p * of.cols + c) * kPairs;
      __builtin_prefetch(at + ahead);
      const int32_t* const lower_at =
          kIsFull ? lower + (p * of.full_cols + c - only_upper) * kPairs : nullptr;
      for (int r = 0; r < Block<kSet, kFactors>::kRegisters; ++r) {
        AddPairs<kSet, kFactors>(at + r * kLanes, kIsFull ? lower_at + r * kLanes : nullptr,
                                 of.factors + kFactors * c, sums[p][r]);
      }
    }
  }
}

// The first `rows` rows of kPanels neighboring panels.
template <InstructionSet kSet, int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyBlock(const Operands& of, Eigen::Index panel,
                                                         int first_register, Eigen::Index rows,
                                                         float* product) {
  constexpr int kRegisters = Block<kSet, kFactors>::kRegisters;
  constexpr int kLanes = Register<kSet>::kLanes;
  typename Block<kSet, kFactors>::Sums sums[kPanels][kRegisters] = {};
  AddColumns<kSet, kFactors, kPanels, false>(of, panel, first_register, of.reading.first,
                                             of.reading.first_full, sums);
  AddColumns<kSet, kFactors, kPanels, true>(of, panel, first_register, of.reading.first_full,
                                            of.cols, sums);
  for (int half = 0; half < 2 * kPanels; ++half) {
    for (int lane = 0; lane < kRegisters * kLanes; ++lane) {
      const Eigen::Index row = half * kPairs + first_register * kLanes + lane;
      if (row >= rows) break;
      for (int f = 0; f < kFactors; ++f) {
        product[kFactors * row + f] = sums[half / 2][lane / kLanes][half % 2][f][lane % kLanes];
      }
    }
  }
}

template <InstructionSet kSet, int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyPanels(const Operands& of, Eigen::Index panel,
                                                          Eigen::Index rows, float* product) {
  for (int r = 0; r < Register<kSet>::kInPanel; r += Block<kSet, kFactors>::kRegisters) {
    MultiplyBlock<kSet, kFactors, kPanels>(of, panel, r, rows, product);
  }
}

template <InstructionSet kSet, int kFactors>
inline __attribute__((always_inline)) void MultiplyBody(const Operands& of, float* product) {
  constexpr int kPanels = Block<kSet, kFactors>::kPanels;
  constexpr Eigen::Index kRows = QuantizedMatrix::kPanelRows;
  constexpr Eigen::Index kStep = kPanels * kRows;
  Eigen::Index row = 0;
  for (; row + kStep <= of.rows; row += kStep) {
    MultiplyPanels<kSet, kFactors, kPanels>(of, row / kRows, kStep, product + kFactors * row);
  }
  for (; row < of.rows; row += kRows) {
    MultiplyPanels<kSet, kFactors, 1>(of, row / kRows, std::min(kRows, of.rows - row),
                                      product + kFactors * row);
  }
}

template <int kFactors>
void MultiplyBaseline(const Operands& of, float* product) {
  MultiplyBody<InstructionSet::kBaseline, kFactors>(of, product);
}

template <int kFactors>
TISSUEFORM_TARGET_AVX2 void MultiplyAvx2(const Operands& of, float* product) {
  MultiplyBody<InstructionSet::kAvx2, kFactors>(of, product);
}

template <int kFactors>
TISSUEFORM_TARGET_AVX512 void MultiplyAvx512(const Operands& of, float* product) {
  MultiplyBody<InstructionSet::kAvx512, kFactors>(of, product);
}

template <int kFactors>
constexpr KernelVersions<void(const Operands&, float*)> kMultiply{
    MultiplyBaseline<kFactors>, MultiplyAvx2<kFactors>, MultiplyAvx512<kFactors>};

void PutHalf(int64_t half, bool second, int32_t* pair) {
  const auto bits = static_cast<uint32_t>(half & 0xffff);
  const auto others = static_cast<uint32_t>(*pair);
  *pair = static_cast<int32_t>(second ? (others & 0xffffU) | bits << 16
                                      : (others & 0xffff0000U) | bits);
}

Eigen::Index NumPanels(Eigen::Index rows) {
  return (rows + QuantizedMatrix::kPanelRows - 1) / QuantizedMatrix::kPanelRows;
}

}  // namespace

QuantizedMatrix::QuantizedMatrix(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols)
    : rows_(rows),
      cols_(cols),
      full_cols_(full_cols),
      steps_(cols, 0.0),
      upper_(NumPanels(rows) * cols),
      lower_(NumPanels(rows) * full_cols) {}

// The largest entry's upper half is the largest that there is.
double QuantizedMatrix::UpperStepOf(double largest) {
  return largest / double{std::numeric_limits<int16_t>::max()};
}

void QuantizedMatrix::SetColumn(Eigen::Index column,
                                const Eigen::Ref<const Eigen::VectorXd>& values) {
  const double step = UpperStepOf(rows_ > 0 ? values.cwiseAbs().maxCoeff() : 0) / kUpper;
  steps_[column] = step;
  const Eigen::Index full_column = column - (cols_ - full_cols_);  // negative: none
  for (Eigen::Index row = 0; row < rows_; ++row) {
    const int64_t whole = step > 0 ? std::llround(values[row] / step) : 0;
    // To the nearest, so that the lower half has a sign of its own.
    const int64_t upper = (whole + kUpper / 2) >> 16;
    const Eigen::Index panel = row / kPanelRows;
    const Eigen::Index lane = row % kPairs;
    const bool second = row % kPanelRows >= kPairs;
    PutHalf(upper, second, &upper_[panel * cols_ + column].pairs[lane]);
    if (full_column >= 0) {
      PutHalf(whole - upper * kUpper, second,
              &lower_[panel * full_cols_ + full_column].pairs[lane]);
    }
  }
}

void QuantizedMatrix::Multiply(const Eigen::MatrixXd& factors, const EvaluationPlan& reading,
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
  const auto& multiply = factors.cols() == 1 ? kMultiply<1> : kMultiply<3>;
  multiply.Active()(of, product);
}

void QuantizedMatrix::Describe(PackedColumns* packed) const {
  packed->steps.insert(packed->steps.end(), steps_.begin(), steps_.end());
  const auto append = [this](const std::vector<Panel>& panels, Eigen::Index cols,
                             std::vector<int16_t>* halves) {
    for (Eigen::Index c = 0; c < cols; ++c) {
      for (Eigen::Index row = 0; row < rows_; ++row) {
        const int32_t pair = panels[row / kPanelRows * cols + c].pairs[row % kPairs];
        halves->push_back(
            static_cast<int16_t>(row % kPanelRows < kPairs ? pair & 0xffff : pair >> 16));
      }
    }
  };
  append(upper_, cols_, &packed->upper);
  append(lower_, full_cols_, &packed->lower);
}

int64_t QuantizedMatrix::BytesNeeded(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols) {
  return NumPanels(rows) * (cols + full_cols) * static_cast<int64_t>(sizeof(Panel));
}

}  // namespace tissueform
