// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/series_calibration.h"

#include <cstdlib>
#include <vector>

#include "gtest/gtest.h"

#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/third_order_lengths.h"

namespace tissueform {
namespace {

constexpr double kAllowance = 2.5;

// Of the second order (0) or of the third (1).
class SeriesCalibrationTest : public ::testing::TestWithParam<bool> {
 protected:
  SeriesCalibrationTest() {
    std::srand(4);
    const Eigen::MatrixXd first = Eigen::MatrixXd::Random(30, 6);
    const Eigen::MatrixXd second = Eigen::MatrixXd::Random(30, NumFieldPairs(6));
    const Eigen::MatrixXd third = Eigen::MatrixXd::Random(30, GetParam() ? NumFieldTriples(6) : 0);
    DescribeSeries(first, second, third, 100, &answers_);
    if (GetParam()) {
      answers_.second_lengths = LengthsOf(second);
      answers_.third_lengths = LengthsOf(third);
    }
  }

  SeriesTerms TermsOf(const Eigen::VectorXd& numbers) const {
    SeriesTerms terms = tissueform::TermsOf(answers_, {numbers.begin(), numbers.end()});
    if (GetParam()) terms.ratio = numbers.norm();
    return terms;
  }
  double Mm(const SeriesTerms& terms) const { return SeriesErrorMm(answers_, terms); }

  PortableAnswers answers_;
};

// The same pose at several sizes, whose errors are as the estimate has them.
TEST_P(SeriesCalibrationTest, IsTheAllowanceTimesTheMeasuredError) {
  const Eigen::VectorXd numbers = Eigen::VectorXd::Random(6);
  const auto error = [](double size) { return 0.3 * size * size * size; };
  std::vector<MeasuredSeries> measured;
  for (const double size : {0.01, 0.02, 0.04}) {
    measured.push_back({TermsOf(size * numbers), error(size)});
  }
  if (GetParam()) measured = {measured.begin(), 1 + measured.begin()};
  CalibrateSeries(measured, kAllowance, &answers_);
  EXPECT_NEAR(Mm(measured[0].terms), kAllowance * error(0.01), 1e-6 * error(0.01));
}

// One order after the last: the third, or the fourth.
TEST_P(SeriesCalibrationTest, FallsWithTheOrderAfterTheLast) {
  const Eigen::VectorXd numbers = 1e-3 * Eigen::VectorXd::Random(6);
  const double whole = Mm(TermsOf(numbers));
  EXPECT_NEAR(whole / Mm(TermsOf(0.5 * numbers)), GetParam() ? 16 : 8, 0.1);
  EXPECT_EQ(Mm(TermsOf(Eigen::VectorXd::Zero(6))), 0);
}

// Nothing is learnt where nothing converged; nothing is promised then.
TEST_P(SeriesCalibrationTest, IsLargeWhereNothingWasMeasured) {
  const SeriesTerms terms = TermsOf(1e-2 * Eigen::VectorXd::Random(6));
  const double unscaled = Mm(terms);
  CalibrateSeries({}, kAllowance, &answers_);
  EXPECT_NEAR(Mm(terms), 50 * kAllowance * unscaled, 1e-9 * unscaled);
}

INSTANTIATE_TEST_SUITE_P(Orders, SeriesCalibrationTest, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "Third" : "Second"; });

}  // namespace
}  // namespace tissueform
