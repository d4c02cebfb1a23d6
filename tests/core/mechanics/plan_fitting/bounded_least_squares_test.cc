// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/bounded_least_squares.h"

#include <cmath>
#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/QR>

#include "tests/testing/handle_problem.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::testing::ElementsAre;
using testing::RandomNumbers;

MatrixXd RandomMatrix(Index rows, Index cols, RandomNumbers* random) {
  return MatrixXd::NullaryExpr(rows, cols, [random] { return random->Next(); });
}

LeastSquaresProblem Unbounded(Index n) {
  return {.residuals = {},
          .A = MatrixXd::Zero(0, n),
          .c = VectorXd::Zero(0),
          .lower = VectorXd::Constant(n, -1e3),
          .upper = VectorXd::Constant(n, 1e3),
          .steps = VectorXd::Constant(n, 1e-4)};
}

LeastSquaresProblem Linear(const MatrixXd& J, const VectorXd& wanted) {
  LeastSquaresProblem problem = Unbounded(J.cols());
  problem.residuals = [J, wanted](const VectorXd& x) -> VectorXd { return J * x - wanted; };
  return problem;
}

// The best of all ways to hold unknowns at one of their bounds or leave them free: 3^n small
// problems without bounds.
double BestByTryingAll(const MatrixXd& J, const VectorXd& wanted, const VectorXd& lower,
                       const VectorXd& upper) {
  const Index n = J.cols();
  double best = std::numeric_limits<double>::infinity();
  for (int code = 0; code < std::lround(std::pow(3, n)); ++code) {
    VectorXd x = VectorXd::Zero(n);
    std::vector<Index> free;
    for (Index i = 0, rest = code; i < n; ++i, rest /= 3) {
      if (rest % 3 == 0) free.push_back(i);
      if (rest % 3 == 1) x[i] = lower[i];
      if (rest % 3 == 2) x[i] = upper[i];
    }
    if (!free.empty()) {
      const MatrixXd J_free = J(Eigen::all, free);
      x(free) = J_free.colPivHouseholderQr().solve(wanted - J * x);
    }
    if ((x.array() < lower.array() - 1e-12).any() || (x.array() > upper.array() + 1e-12).any()) {
      continue;
    }
    best = std::min(best, (J * x - wanted).squaredNorm());
  }
  return best;
}

TEST(BoundedLeastSquaresTest, LinearProblemsWithinBoundsAreSolvedAsByTryingAllWaysToHoldThem) {
  RandomNumbers random(5);
  for (int trial = 0; trial < 40; ++trial) {
    const MatrixXd J = RandomMatrix(7, 5, &random);
    const VectorXd wanted = 3 * RandomMatrix(7, 1, &random);
    LeastSquaresProblem problem = Linear(J, wanted);
    problem.lower = RandomMatrix(5, 1, &random) - VectorXd::Constant(5, 0.5);
    problem.upper = problem.lower + VectorXd::Ones(5) + 0.5 * RandomMatrix(5, 1, &random);
    const auto found = SolveBoundedLeastSquares(problem, VectorXd::Zero(5));
    EXPECT_TRUE(found.converged);
    EXPECT_TRUE((found.x.array() >= problem.lower.array()).all());
    EXPECT_TRUE((found.x.array() <= problem.upper.array()).all());
    EXPECT_NEAR(found.residuals.squaredNorm(),
                BestByTryingAll(J, wanted, problem.lower, problem.upper), 1e-8)
        << trial;
  }
}

TEST(BoundedLeastSquaresTest, BentValleyIsFollowedToItsBottomAndToItsWall) {
  LeastSquaresProblem problem = Unbounded(2);
  problem.residuals = [](const VectorXd& x) -> VectorXd {
    return Eigen::Vector2d(10 * (x[1] - x[0] * x[0]), 1 - x[0]);
  };
  const auto bottom = SolveBoundedLeastSquares(problem, Eigen::Vector2d(-1.2, 1));
  EXPECT_LT((bottom.x - Eigen::Vector2d(1, 1)).norm(), 1e-5);
  EXPECT_THAT(bottom.bounds, ElementsAre(ActiveBound::kNone, ActiveBound::kNone));
  problem.upper[0] = 0.5;
  const auto wall = SolveBoundedLeastSquares(problem, Eigen::Vector2d(-1.2, 1));
  EXPECT_LT((wall.x - Eigen::Vector2d(0.5, 0.25)).norm(), 1e-5);
  EXPECT_THAT(wall.bounds, ElementsAre(ActiveBound::kUpper, ActiveBound::kNone));
}

// Of all x with x0 + x1 = 2 and anything for x2.
TEST(BoundedLeastSquaresTest, RegularizationRowsDecideBetweenEqualSolutions) {
  MatrixXd J(1, 3);
  J << 1, 1, 0;
  LeastSquaresProblem problem = Linear(J, VectorXd::Constant(1, 2));
  problem.A = 1e-4 * MatrixXd::Identity(3, 3);
  problem.c = 1e-4 * Eigen::Vector3d(0, 0, -5);
  const auto found = SolveBoundedLeastSquares(problem, Eigen::Vector3d(7, -3, 0));
  EXPECT_LT((found.x - Eigen::Vector3d(1, 1, 5)).norm(), 1e-3);
}

TEST(BoundedLeastSquaresTest, StartOutsideAndBoundsThatMeetAreKept) {
  LeastSquaresProblem problem = Linear(MatrixXd::Identity(2, 2), Eigen::Vector2d(3, 3));
  problem.lower << 1, -1;
  problem.upper << 1, 2;
  const auto found = SolveBoundedLeastSquares(problem, Eigen::Vector2d(50, -50));
  EXPECT_LT((found.x - Eigen::Vector2d(1, 2)).norm(), 1e-12);
  EXPECT_THAT(found.bounds, ElementsAre(ActiveBound::kUpper, ActiveBound::kUpper));
}

}  // namespace
}  // namespace tissueform
