// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/panel_matrix.h"

#include "gtest/gtest.h"
#include <Eigen/Core>

#include "core/mechanics/prepared_answers/column_packing.h"
#include "tests/testing/every_instruction_set.h"

namespace tissueform {
namespace {

PackedColumns Packed(const Eigen::MatrixXd& dense, Eigen::Index full_cols) {
  PackedColumns packed;
  PackColumns(dense, full_cols, &packed);
  return packed;
}

// A matrix of either kind; `packed` outlives it.
template <typename Matrix>
Matrix MatrixOf(const PackedColumns& packed, const Eigen::MatrixXd& dense, Eigen::Index full_cols) {
  return Matrix(PackedPart{packed.steps.data(), packed.upper.data(), packed.lower.data(),
                           static_cast<size_t>(dense.rows()), static_cast<size_t>(dense.cols()),
                           static_cast<size_t>(full_cols)});
}

PanelMatrix PanelsOf(const Eigen::MatrixXd& dense, Eigen::Index full_cols) {
  return MatrixOf<PanelMatrix>(Packed(dense, full_cols), dense, full_cols);
}

using RowMajorFactors = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

ColumnReading Reading(Eigen::Index first, Eigen::Index first_full) {
  return {static_cast<size_t>(first), static_cast<size_t>(first_full)};
}

template <typename Matrix>
double LargestError(const Eigen::MatrixXd& dense, const Matrix& panels,
                    const RowMajorFactors& factors, const ColumnReading& reading) {
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> product(dense.rows(),
                                                                                factors.cols());
  panels.Multiply(factors.data(), static_cast<size_t>(factors.cols()), reading, product.data());
  const Eigen::Index rest = dense.cols() - static_cast<Eigen::Index>(reading.first);
  const Eigen::MatrixXd expected = dense.rightCols(rest) * factors.bottomRows(rest);
  return (product.cast<double>() - expected).cwiseAbs().maxCoeff();
}

template <typename Matrix>
double LargestError(const Eigen::MatrixXd& dense, const Matrix& panels, Eigen::Index count,
                    const ColumnReading& reading) {
  return LargestError(dense, panels, RowMajorFactors(RowMajorFactors::Random(dense.cols(), count)),
                      reading);
}

class PanelMatrixTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, PanelMatrixTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(PanelMatrixTest, ProductEqualsThatOfADenseMatrix) {
  for (const Eigen::Index rows : {1, 15, 16, 17, 31, 32, 33, 96, 97, 333}) {
    for (const Eigen::Index cols : {1, 3, 30}) {
      const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, cols);
      const PanelMatrix panels = PanelsOf(dense, cols);
      for (const Eigen::Index count : {1, 3}) {
        for (const Eigen::Index first : {Eigen::Index{0}, cols / 2}) {
          EXPECT_LT(LargestError(dense, panels, count, Reading(first, first)),
                    1e-7 * static_cast<double>(cols + 2))
              << rows << " by " << cols << ", " << count << " from " << first;
        }
      }
    }
  }
}

TEST_P(PanelMatrixTest, UpperHalvesAreOffByHalfAStepAtMost) {
  for (const Eigen::Index rows : {1, 17, 33, 333}) {
    // Columns of very different sizes: each has its own step.
    Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, 5);
    dense.col(1) *= 1e3;
    dense.col(2) *= 1e-6;
    dense.col(3).setZero();
    // The lower halves need not be there.
    for (const Eigen::Index full_cols : {0, 5}) {
      const PackedColumns packed = Packed(dense, full_cols);
      const PanelMatrix panels = MatrixOf<PanelMatrix>(packed, dense, full_cols);
      double steps = 0;
      for (Eigen::Index c = 0; c < dense.cols(); ++c) {
        const double upper_step = 65536 * packed.steps[static_cast<size_t>(c)];
        EXPECT_NEAR(upper_step, dense.col(c).cwiseAbs().maxCoeff() / 32767, 1e-12 * upper_step);
        steps += upper_step / 2;
      }
      for (const Eigen::Index count : {1, 3}) {
        // Ones: a small factor of the largest column would hide its error.
        const RowMajorFactors ones = RowMajorFactors::Ones(dense.cols(), count);
        const double error = LargestError(dense, panels, ones, Reading(0, 5));
        EXPECT_LT(error, steps + 1e-4);
        if (rows == 333) {
          EXPECT_GT(error, 0.1 * steps) << "all digits were read";
        }
      }
    }
  }
}

TEST_P(PanelMatrixTest, TheLastColumnsAreReadToTheirLastDigit) {
  for (const Eigen::Index rows : {1, 33, 333}) {
    Eigen::MatrixXd dense = Eigen::MatrixXd::Random(rows, 7);
    dense.rightCols(3) *= 1e3;
    for (const Eigen::Index full_cols : {3, 5, 7}) {
      const PanelMatrix panels = PanelsOf(dense, full_cols);
      for (const Eigen::Index count : {1, 3}) {
        for (const Eigen::Index first : {0, 2}) {
          // Four columns with steps of 3e-5, three to all digits.
          const double error = LargestError(dense, panels, count, Reading(first, 4));
          EXPECT_LT(error, 4 * 1.6e-5 + 3e-4) << full_cols << ", " << first;
          EXPECT_LT(LargestError(dense, panels, count, Reading(first, 7)), 3 * 1.6e-2 + 1e-3);
        }
      }
    }
  }
}

// What the page reads is what servers read, and comes back as it was.
TEST_P(PanelMatrixTest, AgreesWithTheViewOfPackedColumnsAndGivesThemBack) {
  const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(2100, 9);
  const PackedColumns packed = Packed(dense, 4);
  const auto view = MatrixOf<PackedMatrix>(packed, dense, 4);
  const auto panels = MatrixOf<PanelMatrix>(packed, dense, 4);
  for (const Eigen::Index count : {1, 3}) {
    EXPECT_LT(LargestError(dense, view, count, Reading(0, 5)), 1e-6 + 5 * 1.6e-5);
    const RowMajorFactors factors = Eigen::MatrixXd::Random(dense.cols(), count);
    Eigen::MatrixXf of_view(count, dense.rows());
    Eigen::MatrixXf of_panels(count, dense.rows());
    view.Multiply(factors.data(), static_cast<size_t>(count), {1, 7}, of_view.data());
    panels.Multiply(factors.data(), static_cast<size_t>(count), {1, 7}, of_panels.data());
    EXPECT_LT((of_view - of_panels).cwiseAbs().maxCoeff(), 2e-6) << count;
  }
  PackedColumns back;
  panels.Unpack(&back);
  EXPECT_EQ(back.steps, packed.steps);
  EXPECT_EQ(back.upper, packed.upper);
  EXPECT_EQ(back.lower, packed.lower);
}

// Both fuse their multiplications and add columns in the same order.
TEST_P(PanelMatrixTest, AnswersAreThoseOfTheWidestInstructionSet) {
  const Eigen::MatrixXd dense = Eigen::MatrixXd::Random(777, 41);
  const PanelMatrix panels = PanelsOf(dense, 13);
  for (const Eigen::Index count : {1, 3}) {
    const RowMajorFactors factors = Eigen::MatrixXd::Random(dense.cols(), count);
    Eigen::MatrixXf product(count, dense.rows());
    Eigen::MatrixXf widest(count, dense.rows());
    panels.Multiply(factors.data(), static_cast<size_t>(count), {5, 30}, product.data());
    {
      const ScopedInstructionSet scoped(SupportedInstructionSets().front());
      panels.Multiply(factors.data(), static_cast<size_t>(count), {5, 30}, widest.data());
    }
    // Without fused multiplications each of the 36 products is rounded on its own.
    const float allowed = GetParam() == InstructionSet::kBaseline ? 36 * 6e-8F * 36 : 0.0F;
    EXPECT_LE((product - widest).cwiseAbs().maxCoeff(), allowed) << count;
  }
}

TEST_P(PanelMatrixTest, BytesAreThoseOfWholePanels) {
  EXPECT_EQ(PanelsOf(Eigen::MatrixXd::Ones(33, 5), 5).bytes_held(), 2 * 32 * 5 * 4);
  EXPECT_EQ(PanelMatrix::BytesNeeded(32, 5, 5), 32 * 5 * 4);
  EXPECT_EQ(PanelsOf(Eigen::MatrixXd::Ones(33, 5), 2).bytes_held(), 2 * 32 * (5 + 2) * 2);
}

}  // namespace
}  // namespace tissueform
