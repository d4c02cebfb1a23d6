// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"

namespace tissueform {

// Row-major, so that what one column of the matrix is multiplied with lies side by side.
using FloatFactors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// A tall dense matrix in single precision, stored in panels of kPanelRows rows so that a product
// with a few columns streams it once: the whole cost of a frame. Compiled for several instruction
// sets; the one that fits the processor is chosen when the program starts.
class PanelMatrix {
 public:
  static constexpr int kPanelRows = 16;

  PanelMatrix(Eigen::Index rows, Eigen::Index cols);

  void SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values);

  // product = this * factors, #rows by factors.cols(), row-major. Columns are added in their order.
  // REQUIRES: factors has cols() rows and 1 or 3 columns.
  void Multiply(const FloatFactors& factors, float* product) const;

  Eigen::Index rows() const { return rows_; }
  Eigen::Index cols() const { return cols_; }
  int64_t bytes_held() const { return BytesNeeded(rows_, cols_); }
  static int64_t BytesNeeded(Eigen::Index rows, Eigen::Index cols);

 private:
  // One column of a panel.
  struct alignas(64) Panel {
    float rows[kPanelRows] = {};
  };

  Eigen::Index rows_;
  Eigen::Index cols_;
  std::vector<Panel> panels_;  // column c of panel p lies at p * cols + c
};

}  // namespace tissueform
