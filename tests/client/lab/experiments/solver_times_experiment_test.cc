// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/solver_times_experiment.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(SolverTimesTest, FirstBarHasTheSourcesCountsAndASolveCostsLessThanItsFactor) {
  ASSERT_OK_AND_ASSIGN(const SolverTimes times, TimeBar({10, 10, 20}, 3, 1));
  EXPECT_EQ(times.vertices, 2541);
  EXPECT_EQ(times.tets, 12000);
  EXPECT_EQ(times.unknowns, 2541 - 2 * 121);
  // A factor is used again and again, and that pays: computing it costs at least entries^2 /
  // unknowns products (the squares of its columns' lengths, if all were equal), three solves go
  // over it twice for each of x, y and z.
  EXPECT_EQ(times.num_factorizations, 3);
  EXPECT_GT(times.num_solves, times.num_factorizations);
  const double entries = static_cast<double>(times.factor_bytes) / sizeof(double);
  EXPECT_LT(3 * 2 * entries, entries * entries / static_cast<double>(times.unknowns));
  EXPECT_GT(times.three_solves, 0);
  EXPECT_GT(times.analyse, 0);
  EXPECT_GT(times.factorise, 0);
}

}  // namespace
}  // namespace tissueform
