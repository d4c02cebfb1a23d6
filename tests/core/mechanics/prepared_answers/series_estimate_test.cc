// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/series_estimate.h"

#include <cstdlib>
#include <vector>

#include "gtest/gtest.h"

#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/pose_numbers.h"

namespace tissueform {
namespace {

constexpr double kAllowance = 2.5;

// Of the second order (0) or of the third (1).
class SeriesEstimateTest : public ::testing::TestWithParam<bool> {
 protected:
  SeriesEstimateTest() : estimate_(Make()) {}

  static SeriesEstimate Make() {
    std::srand(4);
    return {Eigen::MatrixXd::Random(30, 6), Eigen::MatrixXd::Random(30, NumFieldPairs(6)),
            Eigen::MatrixXd::Random(30, GetParam() ? NumFieldTriples(6) : 0), 100};
  }

  static SeriesEstimate::Terms TermsOf(const Eigen::VectorXd& numbers) {
    SeriesEstimate::Terms terms{.pairs = PairProducts(numbers), .triples = {}};
    if (GetParam()) {
      terms.triples = TripleProducts(numbers);
      terms.ratio = numbers.norm();
    }
    return terms;
  }

  SeriesEstimate estimate_;
};

// The same pose at several sizes, whose errors are as the estimate has them.
TEST_P(SeriesEstimateTest, IsTheAllowanceTimesWhatWasMeasured) {
  const Eigen::VectorXd numbers = Eigen::VectorXd::Random(6);
  const auto error = [](double size) { return 0.3 * size * size * size; };
  std::vector<SeriesEstimate::Measured> measured;
  for (const double size : {0.01, 0.02, 0.04}) {
    measured.push_back({TermsOf(size * numbers), error(size)});
  }
  if (GetParam()) measured = {measured.begin(), 1 + measured.begin()};
  estimate_.Calibrate(measured, kAllowance);
  EXPECT_NEAR(estimate_.Mm(measured[0].terms), kAllowance * error(0.01), 1e-6 * error(0.01));
}

// One order after the last: the third, or the fourth.
TEST_P(SeriesEstimateTest, FallsWithTheOrderAfterTheLast) {
  const Eigen::VectorXd numbers = 1e-3 * Eigen::VectorXd::Random(6);
  const double whole = estimate_.Mm(TermsOf(numbers));
  EXPECT_NEAR(whole / estimate_.Mm(TermsOf(0.5 * numbers)), GetParam() ? 16 : 8, 0.1);
  EXPECT_EQ(estimate_.Mm(TermsOf(Eigen::VectorXd::Zero(6))), 0);
}

// Nothing is learnt where nothing converged; nothing is promised then.
TEST_P(SeriesEstimateTest, IsLargeWhereNothingWasMeasured) {
  const SeriesEstimate::Terms terms = TermsOf(1e-2 * Eigen::VectorXd::Random(6));
  const double unscaled = estimate_.Mm(terms);
  estimate_.Calibrate({}, kAllowance);
  EXPECT_NEAR(estimate_.Mm(terms), 50 * kAllowance * unscaled, 1e-9 * unscaled);
}

INSTANTIATE_TEST_SUITE_P(Orders, SeriesEstimateTest, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "Third" : "Second"; });

}  // namespace
}  // namespace tissueform
