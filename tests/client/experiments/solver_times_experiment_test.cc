// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/solver_times_experiment.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(SolverTimesTest, FirstBarHasTheSourcesCountsAndASolveCostsLessThanItsFactor) {
  ASSERT_OK_AND_ASSIGN(const SolverTimes times, TimeBar({10, 10, 20}, 3, 1));
  EXPECT_EQ(times.vertices, 2541);
  EXPECT_EQ(times.tets, 12000);
  EXPECT_GT(times.three_solves, 0);
  EXPECT_LT(times.three_solves, times.analyse + times.factorise);
}

}  // namespace
}  // namespace tissueform
