// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// A packed matrix for servers, stored in panels of kPanelRows rows so that a product with a few
// columns streams it once: the whole cost of a frame. Compiled for several instruction sets; the
// one that fits the processor is chosen when the program starts.
//
// Upper and lower halves lie apart, and lower ones are read, and kept, of the last columns only: of
// those that matter most. Reading half of the bytes is twice as fast where it counts, after a
// pause: between the frames of one drag at 30 Hz a processor sleeps and loses what its caches held.
//
// Constant: any number of threads may ask at once.
class PanelMatrix {
 public:
  static constexpr bool kReadsByTolerance = true;
  static constexpr bool kKeepsEntries = true;
  static constexpr size_t kPanelRows = 32;

  // Copies. The halves of an entry are one number of 32 bits, as those of PackColumns are.
  explicit PanelMatrix(const PackedPart& part);

  // As PackedMatrix::Multiply.
  void Multiply(const double* factors, size_t width, const ColumnReading& reading,
                float* product) const;

  // Appends all columns as they came.
  void Unpack(PackedColumns* packed) const;

  size_t rows() const { return rows_; }
  size_t columns() const { return columns_; }
  size_t full_columns() const { return full_columns_; }
  size_t bytes_held() const { return BytesNeeded(rows_, columns_, full_columns_); }
  static size_t BytesNeeded(size_t rows, size_t columns, size_t full_columns);

 private:
  // Halves of one column of a panel: those of row i and, above them, of row i + kPanelRows / 2.
  struct alignas(64) Panel {
    int32_t pairs[kPanelRows / 2] = {};
  };

  size_t rows_;
  size_t columns_;
  size_t full_columns_;
  std::vector<double> steps_;  // what the last bit of a column stands for
  std::vector<Panel> upper_;   // column c of panel p lies at p * columns + c
  std::vector<Panel> lower_;   // the i-th full column at p * full_columns + i
};

}  // namespace tissueform
