// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/panel_matrix.h"

#include <algorithm>

#include "core/base/instruction_set.h"

namespace tissueform {
namespace {

constexpr size_t kPairs = PanelMatrix::kPanelRows / 2;

// Vector registers of an instruction set.
template <InstructionSet kSet>
struct Register {
  static constexpr int kLanes = RegisterBytes(kSet) / static_cast<int>(sizeof(float));
  static constexpr int kInPanel =
      static_cast<int>(kPairs) / kLanes;  // registers of pairs in a column of a panel
  using Floats [[gnu::vector_size(RegisterBytes(kSet))]] = float;
  using Pairs [[gnu::vector_size(RegisterBytes(kSet)), gnu::may_alias]] = int32_t;
};

// What is multiplied: panels, factors with the columns' steps in them.
struct Operands {
  const int32_t* upper;
  const int32_t* lower;
  size_t rows;
  size_t cols;
  size_t full_cols;
  ColumnReading reading;
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
    const Operands& of, size_t panel, int first_register, size_t begin, size_t end,
    typename Block<kSet, kFactors>::Sums (&sums)[kPanels][Block<kSet, kFactors>::kRegisters]) {
  if (begin == end) return;  // of.lower may be null
  constexpr int kLanes = Register<kSet>::kLanes;
  const int32_t* const upper = of.upper + panel * of.cols * kPairs + first_register * kLanes;
  const int32_t* const lower =
      kIsFull ? of.lower + panel * of.full_cols * kPairs + first_register * kLanes : nullptr;
  const size_t only_upper = of.cols - of.full_cols;
  // What comes next: the processor's own look ahead ends at every page of 4 KiB.
  const size_t ahead = kPanels * of.cols * kPairs;
  for (size_t c = begin; c < end; ++c) {
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
inline __attribute__((always_inline)) void MultiplyBlock(const Operands& of, size_t panel,
                                                         int first_register, size_t rows,
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
      const size_t row = half * kPairs + first_register * kLanes + lane;
      if (row >= rows) break;
      for (int f = 0; f < kFactors; ++f) {
        product[kFactors * row + f] = sums[half / 2][lane / kLanes][half % 2][f][lane % kLanes];
      }
    }
  }
}

template <InstructionSet kSet, int kFactors, int kPanels>
inline __attribute__((always_inline)) void MultiplyPanels(const Operands& of, size_t panel,
                                                          size_t rows, float* product) {
  for (int r = 0; r < Register<kSet>::kInPanel; r += Block<kSet, kFactors>::kRegisters) {
    MultiplyBlock<kSet, kFactors, kPanels>(of, panel, r, rows, product);
  }
}

template <InstructionSet kSet, int kFactors>
inline __attribute__((always_inline)) void MultiplyBody(const Operands& of, float* product) {
  constexpr int kPanels = Block<kSet, kFactors>::kPanels;
  constexpr size_t kRows = PanelMatrix::kPanelRows;
  constexpr size_t kStep = kPanels * kRows;
  size_t row = 0;
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

void PutHalf(int16_t half, bool second, int32_t* pair) {
  const auto bits = static_cast<uint32_t>(static_cast<uint16_t>(half));
  const auto others = static_cast<uint32_t>(*pair);
  *pair = static_cast<int32_t>(second ? (others & 0xffffU) | bits << 16
                                      : (others & 0xffff0000U) | bits);
}

size_t NumPanels(size_t rows) {
  return (rows + PanelMatrix::kPanelRows - 1) / PanelMatrix::kPanelRows;
}

// `halves` of `columns` columns, one behind the other, into panels.
template <typename Panel>
void PutHalves(const int16_t* halves, size_t rows, size_t columns, std::vector<Panel>* panels) {
  for (size_t c = 0; c < columns; ++c) {
    for (size_t row = 0; row < rows; ++row) {
      Panel& panel = (*panels)[row / PanelMatrix::kPanelRows * columns + c];
      PutHalf(halves[c * rows + row], row % PanelMatrix::kPanelRows >= kPairs,
              &panel.pairs[row % kPairs]);
    }
  }
}

template <typename Panel>
void AppendHalves(const std::vector<Panel>& panels, size_t rows, size_t columns,
                  std::vector<int16_t>* halves) {
  for (size_t c = 0; c < columns; ++c) {
    for (size_t row = 0; row < rows; ++row) {
      const Panel& panel = panels[row / PanelMatrix::kPanelRows * columns + c];
      const int32_t pair = panel.pairs[row % kPairs];
      halves->push_back(static_cast<int16_t>(row % PanelMatrix::kPanelRows < kPairs ? pair & 0xffff
                                                                                    : pair >> 16));
    }
  }
}

}  // namespace

PanelMatrix::PanelMatrix(const PackedPart& part)
    : rows_(part.rows),
      columns_(part.columns),
      full_columns_(part.full),
      steps_(part.steps, part.steps + part.columns),
      upper_(NumPanels(part.rows) * part.columns),
      lower_(NumPanels(part.rows) * part.full) {
  PutHalves(part.upper, rows_, columns_, &upper_);
  PutHalves(part.lower, rows_, full_columns_, &lower_);
}

void PanelMatrix::Multiply(const double* factors, size_t width, const ColumnReading& reading,
                           float* product) const {
  if (upper_.empty()) {
    std::fill_n(product, rows_ * width, 0.0F);
    return;
  }
  std::vector<float> scaled(columns_ * width);
  for (size_t i = 0; i < scaled.size(); ++i) {
    scaled[i] = static_cast<float>(factors[i] * steps_[i / width]);
  }
  const int32_t* const lower = lower_.empty() ? nullptr : lower_.front().pairs;
  const Operands of{upper_.front().pairs, lower,   rows_,        columns_,
                    full_columns_,        reading, scaled.data()};
  const auto& multiply = width == 1 ? kMultiply<1> : kMultiply<3>;
  multiply.Active()(of, product);
}

void PanelMatrix::Unpack(PackedColumns* packed) const {
  packed->steps.insert(packed->steps.end(), steps_.begin(), steps_.end());
  AppendHalves(upper_, rows_, columns_, &packed->upper);
  AppendHalves(lower_, rows_, full_columns_, &packed->lower);
}

size_t PanelMatrix::BytesNeeded(size_t rows, size_t columns, size_t full_columns) {
  return NumPanels(rows) * (columns + full_columns) * sizeof(Panel);
}

}  // namespace tissueform
