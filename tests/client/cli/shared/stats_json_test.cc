// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/stats_json.h"

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(StatsJsonTest, ConvergedAnswerHasNoNotReachedText) { EXPECT_EQ(NotReachedText({}), ""); }

TEST(StatsJsonTest, UnreachedMovementNamesTheObstacle) {
  SolveSummary solve;
  solve.converged = false;
  solve.load = 0.25;
  solve.gave_up = Termination::kBlocked;
  solve.obstacle = "chin would have to pass through jaw";
  EXPECT_EQ(NotReachedText(solve),
            "only 25 % of the movement was reached: chin would have to pass through jaw");
}

TEST(StatsJsonTest, AnAnswerThatHasNotConvergedSaysWhy) {
  SolveSummary solve;
  solve.converged = false;
  solve.iterations = 500;
  solve.residual = 0.5;
  solve.gave_up = Termination::kNoRoom;
  EXPECT_EQ(
      NotReachedText(solve),
      "not converged after 500 iterations (residual 0.5): out of memory for the second factor");
}

}  // namespace
}  // namespace tissueform
