// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/small_product.h"

#include "gtest/gtest.h"
#include <Eigen/Core>

#include "tests/testing/every_instruction_set.h"

namespace tissueform {
namespace {

template <typename Scalar>
using RowMajorMatrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <typename Scalar>
RowMajorMatrix<Scalar> ProductOf(const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>& a,
                                 const RowMajorMatrix<Scalar>& b) {
  RowMajorMatrix<Scalar> product(a.rows(), b.cols());
  MultiplySmall(
      a.data(), b.data(),
      {static_cast<size_t>(a.rows()), static_cast<size_t>(a.cols()), static_cast<size_t>(b.cols())},
      product.data());
  return product;
}

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
        const RowMajorMatrix<double> product = ProductOf(a, b);
        EXPECT_TRUE(product.isApprox(expected, 1e-13) || (product - expected).norm() < 1e-15);
        const RowMajorMatrix<float> singles =
            ProductOf(Eigen::MatrixXf(a.cast<float>()), RowMajorMatrix<float>(b.cast<float>()));
        EXPECT_LE((singles.cast<double>() - expected).norm(), 1e-5 * (1 + expected.norm()));
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
