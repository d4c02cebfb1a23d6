// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"

namespace tissueform {

// A tall dense matrix, stored in panels of kPanelRows rows so that a product with a few columns
// streams it once: the whole cost of a frame. Compiled for several instruction sets; the one that
// fits the processor is chosen when the program starts.
//
// Entries are fixed-point numbers of 32 bits, each column by its own largest one. Upper and lower
// halves lie apart: a product for which 16 bits are enough reads half of the bytes. That is twice
// as fast where it counts, after a pause: between the frames of one drag at 30 Hz a processor
// sleeps and loses what its caches held (measured: 0.35 ms in place of 0.09 for 2.6 MB).
class PanelMatrix {
 public:
  static constexpr int kPanelRows = 32;

  // How much of the entries a product reads.
  enum class Digits { kUpperHalf, kAll };

  PanelMatrix(Eigen::Index rows, Eigen::Index cols);

  // REQUIRES: finite values.
  void SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values);

  // product = this * factors, #rows by factors.cols(), row-major, in single precision, without the
  // columns before `first`. Columns are added in their order. REQUIRES: factors has cols() rows and
  // 1 or 3 columns.
  void Multiply(const Eigen::MatrixXd& factors, Eigen::Index first, Digits digits,
                float* product) const;

  // Entries whose upper half alone is read lie at most half of this from what they are; all digits
  // lose less than single precision does.
  double upper_step(Eigen::Index column) const { return steps_[column] * kUpper; }

  Eigen::Index rows() const { return rows_; }
  Eigen::Index cols() const { return cols_; }
  int64_t bytes_held() const { return BytesNeeded(rows_, cols_); }
  static int64_t BytesNeeded(Eigen::Index rows, Eigen::Index cols);

 private:
  static constexpr int32_t kUpper = 1 << 16;  // steps in one of the upper half

  // Halves of one column of a panel: those of row i and, above them, of row i + kPanelRows / 2.
  struct alignas(64) Panel {
    int32_t pairs[kPanelRows / 2] = {};
  };

  Eigen::Index rows_;
  Eigen::Index cols_;
  std::vector<double> steps_;  // what the last bit of a column stands for
  std::vector<Panel> upper_;   // column c of panel p lies at p * cols + c
  std::vector<Panel> lower_;
};

}  // namespace tissueform
