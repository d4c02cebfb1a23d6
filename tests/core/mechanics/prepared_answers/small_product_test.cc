// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/small_product.h"

#include "gtest/gtest.h"

#include "tests/testing/every_instruction_set.h"

namespace tissueform {
namespace {

class SmallProductTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, SmallProductTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(SmallProductTest, EqualsEigensProductOfAnySize) {
  for (const Eigen::Index rows : {0, 1, 15, 16, 17, 31, 32, 33, 47, 165}) {
    for (const Eigen::Index inner : {0, 1, 12, 165}) {
      for (const Eigen::Index cols : {1, 2, 3, 4, 9}) {
        const Eigen::MatrixXd a = Eigen::MatrixXd::Random(rows, inner);
        const RowMajorMatrix<double> b = Eigen::MatrixXd::Random(inner, cols);
        const Eigen::MatrixXd expected = a * b;
        const RowMajorMatrix<double> product = MultiplySmall(a, b);
        ASSERT_EQ(product.rows(), rows);
        ASSERT_EQ(product.cols(), cols);
        EXPECT_TRUE(product.isApprox(expected, 1e-13) || (product - expected).norm() < 1e-15);
        const RowMajorMatrix<float> singles =
            MultiplySmall(Eigen::MatrixXf(a.cast<float>()), RowMajorMatrix<float>(b.cast<float>()));
        EXPECT_LE((singles.cast<double>() - expected).norm(), 1e-5 * (1 + expected.norm()));
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
