// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// A tall dense matrix, stored in panels of kPanelRows rows so that a product with a few columns
// streams it once: the whole cost of a frame. Compiled for several instruction sets; the one that
// fits the processor is chosen when the program starts.
//
// Entries are fixed-point numbers of 32 bits, each column by its own largest one. Upper and lower
// halves lie apart, and lower ones are read, and kept, of the last columns only: of those that
// matter most. Reading half of the bytes is twice as fast where it counts, after a pause: between
// the frames of one drag at 30 Hz a processor sleeps and loses what its caches held.
class QuantizedMatrix {
 public:
  static constexpr int kPanelRows = 32;

  // The last `full_cols` columns have all digits, the others their upper half.
  QuantizedMatrix(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols);

  // REQUIRES: finite values.
  void SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values);

  // How much of the columns a product reads.
  struct EvaluationPlan {
    Eigen::Index first = 0;       // those before it are left out
    Eigen::Index first_full = 0;  // from it on with all digits
  };

  // product = this * factors, #rows by factors.cols(), row-major, in single precision. Columns are
  // added in their order. REQUIRES: factors has cols() rows and 1 or 3 columns; cols() -
  // full_cols()
  // <= first_full <= cols(), and first <= first_full.
  void Multiply(const Eigen::MatrixXd& factors, const EvaluationPlan& reading,
                float* product) const;

  // Entries whose upper half alone is read lie at most half of this from what they are; all digits
  // lose less than single precision does.
  double upper_step(Eigen::Index column) const { return steps_[column] * kUpper; }
  // The same for a column with that largest entry.
  static double UpperStepOf(double largest);

  // Appends all columns as they are kept.
  void Describe(PackedColumns* packed) const;

  Eigen::Index rows() const { return rows_; }
  Eigen::Index cols() const { return cols_; }
  Eigen::Index full_cols() const { return full_cols_; }
  int64_t bytes_held() const { return BytesNeeded(rows_, cols_, full_cols_); }
  static int64_t BytesNeeded(Eigen::Index rows, Eigen::Index cols, Eigen::Index full_cols);

 private:
  static constexpr int32_t kUpper = 1 << 16;  // steps in one of the upper half

  // Halves of one column of a panel: those of row i and, above them, of row i + kPanelRows / 2.
  struct alignas(64) Panel {
    int32_t pairs[kPanelRows / 2] = {};
  };

  Eigen::Index rows_;
  Eigen::Index cols_;
  Eigen::Index full_cols_;
  std::vector<double> steps_;  // what the last bit of a column stands for
  std::vector<Panel> upper_;   // column c of panel p lies at p * cols + c
  std::vector<Panel> lower_;   // the i-th full column at p * full_cols + i
};

}  // namespace tissueform
