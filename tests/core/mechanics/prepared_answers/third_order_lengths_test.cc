// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/third_order_lengths.h"

#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/series_terms.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"

namespace tissueform {
namespace {

// Turns move a head's vertices by tens of mm a unit, their triples by tens of thousands: the sizes
// of columns differ as much.
Eigen::MatrixXd ColumnsOf(const Eigen::VectorXd& sizes, Eigen::Index rows, uint32_t seed) {
  std::srand(seed);
  return Eigen::MatrixXd::Random(rows, sizes.size()) * sizes.cwiseAbs().asDiagonal();
}

Eigen::VectorXd PairProducts(const Eigen::VectorXd& numbers) {
  const SeriesTerms terms = TermsOf({}, {numbers.begin(), numbers.end()});
  return Eigen::Map<const Eigen::VectorXd>(terms.pairs.data(), NumFieldPairs(numbers.size()));
}

struct Columns {
  explicit Columns(Eigen::Index rows) {
    const Eigen::VectorXd units = (Eigen::VectorXd(6) << 50, 40, 30, 1, 1, 1).finished();
    second = ColumnsOf(PairProducts(units), rows, 1);
    third = ColumnsOf(TripleProducts(units), rows, 2);
  }

  double Ratio(const Eigen::VectorXd& numbers) const {
    PortableAnswers answers;
    answers.second_lengths = LengthsOf(second);
    answers.third_lengths = LengthsOf(third);
    return TermsOf(answers, {numbers.begin(), numbers.end()}).ratio;
  }
  double Expected(const Eigen::VectorXd& numbers) const {
    return (third * TripleProducts(numbers)).norm() / (second * PairProducts(numbers)).norm();
  }

  Eigen::MatrixXd second;
  Eigen::MatrixXd third;
};

class ThirdOrderLengthsTest : public ::testing::TestWithParam<int> {};

// Turns alone, moves alone, and both; of more rows than columns, and of fewer.
TEST_P(ThirdOrderLengthsTest, RatioIsThatOfTheDisplacementsLengths) {
  const Columns columns(3 * GetParam());
  std::srand(3);
  for (int sample = 0; sample < 30; ++sample) {
    Eigen::VectorXd numbers = 0.1 * Eigen::VectorXd::Random(6);
    if (sample % 3 == 0) numbers.head<3>().setZero();
    if (sample % 3 == 1) numbers.tail<3>().setZero();
    const double expected = columns.Expected(numbers);
    EXPECT_NEAR(columns.Ratio(numbers), expected, 1e-4 * expected) << sample;
  }
}

TEST_P(ThirdOrderLengthsTest, RestAndZeroColumnsHaveZeroRatio) {
  Columns columns(3 * GetParam());
  EXPECT_EQ(columns.Ratio(Eigen::VectorXd::Zero(6)), 0);
  columns.second.setZero();
  columns.third.setZero();
  EXPECT_EQ(columns.Ratio(Eigen::VectorXd::Ones(6)), 0);
}

INSTANTIATE_TEST_SUITE_P(Vertices, ThirdOrderLengthsTest, ::testing::Values(1, 200),
                         [](const auto& test) { return test.param == 1 ? "One" : "Many"; });

}  // namespace
}  // namespace tissueform
