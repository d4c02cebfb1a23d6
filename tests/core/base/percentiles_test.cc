// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/percentiles.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// 1, 2, ..., count.
std::vector<double> Counted(int count) {
  std::vector<double> values(static_cast<size_t>(count));
  std::iota(values.begin(), values.end(), 1.0);
  return values;
}

// numpy.percentile(values, percent, method="inverted_cdf") of numpy 1.24.
TEST(PercentilesTest, AreThoseOfNumpysInvertedCdf) {
  const std::vector<double> values = {35, 20, 15, 50, 40};
  EXPECT_EQ(Percentile(values, 0), 15);
  EXPECT_EQ(Percentile(values, 5), 15);
  EXPECT_EQ(Percentile(values, 20), 15);
  EXPECT_EQ(Percentile(values, 30), 20);
  EXPECT_EQ(Percentile(values, 40), 20);
  EXPECT_EQ(Percentile(values, 50), 35);
  EXPECT_EQ(Percentile(values, 99), 50);
  EXPECT_EQ(Percentile(values, 100), 50);
}

TEST(PercentilesTest, OfAHundredValuesAreTheirRanks) {
  for (int percent = 1; percent <= 100; ++percent) {
    EXPECT_EQ(Percentile(Counted(100), percent), percent);
    EXPECT_EQ(Percentile(Counted(1000), percent), 10 * percent);
  }
}

TEST(PercentilesTest, OfFewValuesTheNinetyNinthIsTheLargest) {
  EXPECT_EQ(Percentile(Counted(99), 99), 99);
  EXPECT_EQ(Percentile(Counted(101), 99), 100);
  EXPECT_EQ(Percentile({0.25}, 1), 0.25);
}

TEST(PercentilesTest, SortedOrNotTheyAreTheSame) {
  std::vector<double> values = {3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 5};
  std::vector<double> rising = values;
  std::sort(rising.begin(), rising.end());
  for (const double percent : {0.0, 1.0, 12.5, 50.0, 90.0, 95.0, 99.0, 99.9, 100.0}) {
    EXPECT_EQ(PercentileOfRising(rising, percent), Percentile(values, percent)) << percent;
  }
}

TEST(PercentilesTest, MedianOfAnEvenNumberIsTheMeanOfTheTwoInTheMiddle) {
  EXPECT_EQ(Median({3, 1, 2}), 2);
  EXPECT_EQ(Median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(Median({7}), 7);
}

}  // namespace
}  // namespace tissueform
