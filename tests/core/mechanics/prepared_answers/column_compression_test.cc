// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/column_compression.h"

#include <algorithm>
#include <cmath>

#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/compression_error.h"

namespace tissueform {
namespace {

constexpr int kRows = 60;

// Columns that `rank` fields make up, whose sizes fall by a factor of ten from one to the next.
Eigen::MatrixXd FallingColumns(Eigen::Index columns, Eigen::Index rank) {
  Eigen::MatrixXd fields = Eigen::MatrixXd::Random(kRows, rank);
  for (Eigen::Index r = 0; r < rank; ++r) fields.col(r) *= 10 * std::pow(0.1, r);
  return fields * Eigen::MatrixXd::Random(rank, columns);
}

ColumnWeights RandomUses(Eigen::Index columns, int factors, double size = 1) {
  const Eigen::Index poses = 100;
  return {.factors = factors,
          .typical = size * Eigen::MatrixXd::Random(columns, factors * poses),
          .widest = size * Eigen::MatrixXd::Random(columns, factors * poses)};
}

// What becomes of factors, by the evaluator.
Eigen::MatrixXd MapOf(const ColumnCompression& compression) {
  PortableAnswers answers;
  compression.Describe(&answers);
  const Eigen::Index columns = static_cast<Eigen::Index>(answers.tail.size());
  return Eigen::Map<const Eigen::MatrixXd>(answers.map.data(), compression.num_kept(), columns);
}

double CutBoundMm(const ColumnCompression& compression, const Eigen::MatrixXd& factors) {
  PortableAnswers answers;
  compression.Describe(&answers);
  AnswerSizes sizes;
  sizes.factors = static_cast<size_t>(factors.rows());
  sizes.factor_width = static_cast<size_t>(factors.cols());
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> by_row = factors;
  return CutErrorMm(answers, sizes, {by_row.data(), by_row.data() + by_row.size()});
}

// How far the kept columns put a vertex off for these factors. Rows are coordinates of vertices for
// one factor, scalars of vertices for three.
double ErrorOf(const ColumnCompression& compression, const Eigen::MatrixXd& columns,
               const Eigen::MatrixXd& factors) {
  const Eigen::MatrixXd error =
      columns * factors - compression.kept() * (MapOf(compression) * factors);
  if (factors.cols() == 3) return error.rowwise().norm().maxCoeff();
  return error.col(0).reshaped(3, error.rows() / 3).colwise().norm().maxCoeff();
}

TEST(ColumnCompressionTest, KeepsAsManyColumnsAsTheToleranceNeeds) {
  const Eigen::MatrixXd columns = FallingColumns(20, 7);
  const ColumnWeights uses = RandomUses(20, 1);
  Eigen::Index before = 0;
  for (const double tolerance : {100.0, 1.0, 1e-2, 1e-4, 1e-7}) {
    const ColumnCompression compression(columns, 3, uses, tolerance);
    EXPECT_EQ(MapOf(compression).cols(), 20);
    EXPECT_EQ(compression.kept().cols(), compression.num_kept());
    EXPECT_GE(compression.num_kept(), before);
    before = compression.num_kept();
    for (Eigen::Index pose = 0; pose < uses.widest.cols(); ++pose) {
      const double error = ErrorOf(compression, columns, uses.widest.col(pose));
      EXPECT_LE(error, tolerance);
      EXPECT_LE(error, CutBoundMm(compression, uses.widest.col(pose)) + 1e-12);
      EXPECT_LE(CutBoundMm(compression, uses.widest.col(pose)), 1.06 * tolerance);
    }
  }
  EXPECT_EQ(ColumnCompression(columns, 3, uses, 100.0).num_kept(), 0) << "nothing matters";
  EXPECT_EQ(before, 7) << "that is their rank";
}

// Also of uses that were never tried, far beyond those that the columns were turned for.
TEST(ColumnCompressionTest, BoundHoldsForEveryUse) {
  for (const int factors : {1, 3}) {
    const Eigen::MatrixXd columns = FallingColumns(15, 9);
    const ColumnCompression compression(columns, factors == 1 ? 3 : 1, RandomUses(15, factors),
                                        1e-3);
    EXPECT_LT(compression.num_kept(), 9);
    double tightest = 1e9;
    for (const double size : {1e-3, 1.0, 1e3}) {
      for (int sample = 0; sample < 300; ++sample) {
        const Eigen::MatrixXd use = size * Eigen::MatrixXd::Random(15, factors);
        const double error = ErrorOf(compression, columns, use);
        const double bound = CutBoundMm(compression, use);
        EXPECT_LE(error, bound + 1e-13 * size);
        tightest = std::min(tightest, bound / error);
      }
    }
    EXPECT_LT(tightest, 10) << "a bound that says nothing";
  }
}

// Two columns that are always used together are one.
TEST(ColumnCompressionTest, MergesColumnsThatAreUsedTogether) {
  const Eigen::MatrixXd columns = Eigen::MatrixXd::Random(kRows, 6);
  ColumnWeights uses = RandomUses(6, 1);
  for (Eigen::MatrixXd* some : {&uses.typical, &uses.widest}) {
    some->bottomRows(3) = 0.5 * some->topRows(3);
  }
  const ColumnCompression compression(columns, 3, uses, 1e-6);
  EXPECT_EQ(compression.num_kept(), 3);
  // Used otherwise they are answered badly, and the bound says so.
  const Eigen::VectorXd alone = Eigen::VectorXd::Unit(6, 5);
  EXPECT_GT(ErrorOf(compression, columns, alone), 1e-2);
  EXPECT_GE(CutBoundMm(compression, alone), ErrorOf(compression, columns, alone));
}

TEST(ColumnCompressionTest, KeepsColumnsThatOnlyTheWidestUseNeeds) {
  const Eigen::MatrixXd columns = Eigen::MatrixXd::Random(kRows, 4);
  ColumnWeights uses = RandomUses(4, 1);
  uses.typical.row(2).setZero();
  const ColumnCompression compression(columns, 3, uses, 1e-6);
  EXPECT_EQ(compression.num_kept(), 4);
  EXPECT_LT(ErrorOf(compression, columns, Eigen::VectorXd::Unit(4, 2)), 1e-7);
}

TEST(ColumnCompressionTest, ColumnsThatMatterLeastComeFirst) {
  const Eigen::MatrixXd columns = FallingColumns(12, 6);
  const ColumnWeights uses = RandomUses(12, 1);
  const ColumnCompression compression(columns, 3, uses, 1e-9);
  const Eigen::MatrixXd coefficients = MapOf(compression) * uses.widest;
  double before = 0;
  for (Eigen::Index c = 0; c < compression.num_kept(); ++c) {
    const double moves =
        compression.kept().col(c).reshaped(3, kRows / 3).colwise().norm().maxCoeff() *
        coefficients.row(c).cwiseAbs().maxCoeff();
    EXPECT_GE(moves, before * (1 - 1e-9));
    before = moves;
  }
}

}  // namespace
}  // namespace tissueform
