// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/histogram.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

TEST(HistogramTest, ValuesBeyondTheEndsAreCountedThere) {
  const Histogram histogram = CountInBins({-5, 0, 0.99, 1, 2.5, 3, 99}, 0, 1, 3);
  EXPECT_THAT(histogram.counts, ElementsAre(3, 1, 3));
}

TEST(HistogramTest, CurveEnclosesAllValues) {
  const Histogram histogram = CountInBins({0.5, 0.5, 0.5, 1.5}, 0, 1, 3);
  const Curve curve = HistogramCurve(histogram, "values", kBlue);
  EXPECT_THAT(curve.x, ElementsAre(0, 0, 1, 1, 2, 2, 3, 3));
  EXPECT_THAT(curve.y, ElementsAre(0, 75, 75, 25, 25, 0, 0, 0));
}

TEST(HistogramTest, NothingFallsBelowTheFloorOfALogarithmicAxis) {
  const Curve curve = HistogramCurve(CountInBins({}, 0, 1, 2), "nothing", kBlue, 0.01);
  EXPECT_THAT(curve.y, ::testing::Each(0.01));
}

}  // namespace
}  // namespace tissueform
