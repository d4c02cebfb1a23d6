// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/quantized_matrix.h"

#include "gtest/gtest.h"

#include "tests/testing/every_instruction_set.h"

namespace tissueform {
namespace {

using EvaluationPlan = QuantizedMatrix::EvaluationPlan;

QuantizedMatrix PanelsOf(const Eigen::MatrixXd& dense, Eigen::Index full_cols) {
  QuantizedMatrix panels(dense.rows(), dense.cols(), full_cols);
  for (Eigen::Index c = 0; c < dense.cols(); ++c) panels.SetColumn(c, dense.col(c));
  return panels;
}

double LargestError(const Eigen::MatrixXd& dense, const QuantizedMatrix& panels, Eigen::Index count,
                    const EvaluationPlan& reading) {
  const Eigen::MatrixXd factors = Eigen::MatrixXd::Random(dense.cols(), count);
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> product(dense.rows(),
                                                                                count);
  panels.Multiply(factors, reading, product.data());
  const Eigen::Index rest = dense.cols() - reading.first;
  const Eigen::MatrixXd expected = dense.rightCols(rest) * factors.bottomRows(rest);
  return (product.cast<double>() - expected).cwiseAbs().maxCoeff();
}

class QuantizedMatrixTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, QuantizedMatrixTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(QuantizedMatrixTest, ProductEqualsThatOfADenseMatrix) {
  for (const Eigen::Index rows : {1, 15, 16, 17, 31, 32, 33, 96, 97, 333}) {
    for (const Eigen::Index cols : {1, 3, 30}) {
      const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, cols);
      const QuantizedMatrix panels = PanelsOf(dense, cols);
      for (const Eigen::Index count : {1, 3}) {
        for (const Eigen::Index first : {Eigen::Index{0}, cols / 2}) {
          EXPECT_LT(LargestError(dense, panels, count, {first, first}),
                    1e-7 * static_cast<double>(cols + 2))
              << rows << " by " << cols << ", " << count << " from " << first;
        }
      }
    }
  }
}

TEST_P(QuantizedMatrixTest, UpperHalvesAreOffByHalfAStepAtMost) {
  for (const Eigen::Index rows : {1, 17, 33, 333}) {
    // Columns of very different sizes: each has its own step.
    Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, 5);
    dense.col(1) *= 1e3;
    dense.col(2) *= 1e-6;
    dense.col(3).setZero();
    // The lower halves need not be there.
    for (const Eigen::Index full_cols : {0, 5}) {
      const QuantizedMatrix panels = PanelsOf(dense, full_cols);
      double steps = 0;
      for (Eigen::Index c = 0; c < dense.cols(); ++c) {
        EXPECT_NEAR(panels.upper_step(c), dense.col(c).cwiseAbs().maxCoeff() / 32767,
                    1e-12 * panels.upper_step(c));
        steps += panels.upper_step(c) / 2;  // factors are at most 1
      }
      for (const Eigen::Index count : {1, 3}) {
        const double error = LargestError(dense, panels, count, {0, 5});
        EXPECT_LT(error, steps + 1e-4);
        if (rows == 333) {
          EXPECT_GT(error, 0.1 * steps) << "all digits were read";
        }
      }
    }
  }
}

TEST_P(QuantizedMatrixTest, TheLastColumnsAreReadToTheirLastDigit) {
  for (const Eigen::Index rows : {1, 33, 333}) {
    Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, 7);
    dense.rightCols(3) *= 1e3;
    for (const Eigen::Index full_cols : {3, 5, 7}) {
      const QuantizedMatrix panels = PanelsOf(dense, full_cols);
      for (const Eigen::Index count : {1, 3}) {
        for (const Eigen::Index first : {0, 2}) {
          // Four columns with steps of 3e-5, three to all digits.
          const double error = LargestError(dense, panels, count, {first, 4});
          EXPECT_LT(error, 4 * 1.6e-5 + 3e-4) << full_cols << ", " << first;
          EXPECT_LT(LargestError(dense, panels, count, {first, 7}), 3 * 1.6e-2 + 1e-3);
        }
      }
    }
  }
}

TEST_P(QuantizedMatrixTest, AColumnIsReplacedByTheNext) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Random(40, 2);
  QuantizedMatrix panels = PanelsOf(dense, 2);
  dense.col(1) = 3 * Eigen::VectorXd::Random(40);
  panels.SetColumn(1, dense.col(1));
  EXPECT_LT(LargestError(dense, panels, 1, {0, 0}), 1e-6);
}

// Both fuse their multiplications and add columns in the same order.
TEST_P(QuantizedMatrixTest, AnswersAreThoseOfTheWidestInstructionSet) {
  const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(777, 41);
  const QuantizedMatrix panels = PanelsOf(dense, 13);
  for (const Eigen::Index count : {1, 3}) {
    const Eigen::MatrixXd factors = Eigen::MatrixXd::Random(dense.cols(), count);
    Eigen::MatrixXf product(count, dense.rows());
    Eigen::MatrixXf widest(count, dense.rows());
    panels.Multiply(factors, {5, 30}, product.data());
    {
      const ScopedInstructionSet scoped(SupportedInstructionSets().front());
      panels.Multiply(factors, {5, 30}, widest.data());
    }
    // Without fused multiplications each of the 36 products is rounded on its own.
    const float allowed = GetParam() == InstructionSet::kBaseline ? 36 * 6e-8F * 36 : 0.0F;
    EXPECT_LE((product - widest).cwiseAbs().maxCoeff(), allowed) << count;
  }
}

TEST_P(QuantizedMatrixTest, BytesAreThoseOfWholePanels) {
  EXPECT_EQ(QuantizedMatrix(33, 5, 5).bytes_held(), 2 * 32 * 5 * 4);
  EXPECT_EQ(QuantizedMatrix::BytesNeeded(32, 5, 5), 32 * 5 * 4);
  EXPECT_EQ(QuantizedMatrix(33, 5, 2).bytes_held(), 2 * 32 * (5 + 2) * 2);
}

}  // namespace
}  // namespace tissueform
