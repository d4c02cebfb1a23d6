// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_matrix.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(PanelMatrixTest, ProductEqualsThatOfADenseMatrix) {
  for (const Eigen::Index rows : {1, 15, 16, 17, 31, 96, 97, 333}) {
    for (const Eigen::Index cols : {1, 3, 30}) {
      const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, cols);
      PanelMatrix panels(rows, cols);
      for (Eigen::Index c = 0; c < cols; ++c) {
        panels.SetColumn(c, dense.col(c));
      }
      for (const Eigen::Index count : {1, 3}) {
        const FloatFactors factors = FloatFactors::Random(cols, count);
        FloatFactors product(rows, count);
        panels.Multiply(factors, product.data());
        const Eigen::MatrixXd expected = dense * factors.cast<double>();
        EXPECT_LT((product.cast<double>() - expected).cwiseAbs().maxCoeff(),
                  1e-7 * static_cast<double>(cols + 2))
            << rows << " by " << cols << ", " << count;
      }
    }
  }
}

TEST(PanelMatrixTest, BytesAreThoseOfWholePanels) {
  EXPECT_EQ(PanelMatrix(17, 5).bytes_held(), 2 * 16 * 5 * 4);
  EXPECT_EQ(PanelMatrix::BytesNeeded(16, 5), 16 * 5 * 4);
}

}  // namespace
}  // namespace tissueform
