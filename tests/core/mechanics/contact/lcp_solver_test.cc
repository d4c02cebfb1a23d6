// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/contact/lcp_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Cholesky>

#include "tests/testing/handle_problem.h"

namespace tissueform {
namespace {

using testing::RandomNumbers;

std::span<const double> NumbersOf(const Eigen::MatrixXd& matrix) {
  return {matrix.data(), static_cast<size_t>(matrix.size())};
}

LcpSolver SolverOf(const Eigen::MatrixXd& C, const LcpOptions& options = {}) {
  return {NumbersOf(C), static_cast<size_t>(C.rows()), options};
}

Eigen::VectorXd VectorOf(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(),
                                           static_cast<Eigen::Index>(numbers.size()));
}

Eigen::VectorXd RandomVector(Eigen::Index size, RandomNumbers* random) {
  return Eigen::VectorXd::NullaryExpr(size, [random] { return random->Next(); });
}

// Products of random rows, positive definite: `shift` is the smallest eigenvalue's size.
Eigen::MatrixXd RandomCompliance(Eigen::Index rows, double shift, RandomNumbers* random) {
  Eigen::MatrixXd factor(rows, rows);
  for (double& entry : factor.reshaped()) entry = random->Next();
  return factor * factor.transpose() + shift * Eigen::MatrixXd::Identity(rows, rows);
}

// As of points along a line that press on one elastic body: near ones move together.
Eigen::MatrixXd LineCompliance(Eigen::Index rows, double reach) {
  return Eigen::MatrixXd::NullaryExpr(rows, rows, [reach](Eigen::Index i, Eigen::Index j) {
    return std::exp(-std::abs(static_cast<double>(i - j)) / reach);
  });
}

// The multipliers of the one active set that fulfills all conditions, by trying all of them.
std::optional<Eigen::VectorXd> EnumeratedSolution(const Eigen::MatrixXd& C,
                                                  const Eigen::VectorXd& q, double tolerance) {
  const auto rows = static_cast<int>(q.size());
  for (uint32_t set = 0; set < (1U << rows); ++set) {
    std::vector<Eigen::Index> active;
    for (int row = 0; row < rows; ++row) {
      if ((set >> row & 1U) != 0) active.push_back(row);
    }
    Eigen::VectorXd l = Eigen::VectorXd::Zero(rows);
    if (!active.empty()) {
      const Eigen::MatrixXd C_active = C(active, active);
      const Eigen::VectorXd q_active = q(active);
      l(active) = -C_active.ldlt().solve(q_active);
    }
    if ((C * l + q).minCoeff() >= -tolerance && l.minCoeff() >= -tolerance) return l;
  }
  return std::nullopt;
}

double EnergyOf(const Eigen::MatrixXd& C, const Eigen::VectorXd& q, const Eigen::VectorXd& l) {
  return 0.5 * l.dot(C * l) + q.dot(l);
}

void ExpectComplementary(const LcpSolution& solution, const Eigen::MatrixXd& C,
                         const Eigen::VectorXd& q) {
  const Eigen::VectorXd l = VectorOf(solution.multipliers);
  const Eigen::VectorXd g = VectorOf(solution.gaps_mm);
  EXPECT_TRUE(solution.converged);
  EXPECT_LT(solution.kkt_residual_mm, 1e-11);
  EXPECT_LT((q + C * l - g).lpNorm<Eigen::Infinity>(), 1e-11);
  EXPECT_GE(l.minCoeff(), 0.0);
  EXPECT_GT(g.minCoeff(), -1e-11);
  EXPECT_LT(l.cwiseProduct(g).lpNorm<Eigen::Infinity>(), 1e-10);
  for (Eigen::Index row = 0; row < q.size(); ++row) {
    const bool is_active = std::binary_search(solution.active.begin(), solution.active.end(),
                                              static_cast<int32_t>(row));
    if (!is_active) {
      EXPECT_EQ(l[row], 0.0) << row;
    }
  }
}

TEST(LcpSolverTest, EqualsTheEnumerationOfAllActiveSets) {
  RandomNumbers random(11);
  for (int trial = 0; trial < 60; ++trial) {
    const Eigen::Index rows = 1 + trial % 10;
    const Eigen::MatrixXd C = RandomCompliance(rows, 0.05, &random);
    const Eigen::VectorXd q = RandomVector(rows, &random);
    const auto expected = EnumeratedSolution(C, q, 1e-13);
    ASSERT_TRUE(expected.has_value());
    LcpSolver solver = SolverOf(C);
    const LcpSolution& solution = solver.Solve(NumbersOf(q));
    ExpectComplementary(solution, C, q);
    EXPECT_LT((VectorOf(solution.multipliers) - *expected).norm(), 1e-9 * (1 + expected->norm()));
  }
}

TEST(LcpSolverTest, EqualsTheEnumerationOnTwelveRows) {
  RandomNumbers random(12);
  const Eigen::MatrixXd C = RandomCompliance(12, 0.05, &random);
  LcpSolver solver = SolverOf(C);
  for (int trial = 0; trial < 3; ++trial) {
    const Eigen::VectorXd q = RandomVector(12, &random);
    const auto expected = EnumeratedSolution(C, q, 1e-13);
    ASSERT_TRUE(expected.has_value());
    const Eigen::VectorXd l = VectorOf(solver.Solve(NumbersOf(q)).multipliers);
    EXPECT_LT((l - *expected).norm(), 1e-9 * (1 + expected->norm()));
  }
}

TEST(LcpSolverTest, OpenRowsHaveNoMultiplier) {
  RandomNumbers random(13);
  const Eigen::MatrixXd C = RandomCompliance(9, 0.1, &random);
  const Eigen::VectorXd q = RandomVector(9, &random).cwiseAbs();
  LcpSolver solver = SolverOf(C);
  const LcpSolution& solution = solver.SolveFrom(NumbersOf(q), std::vector<int32_t>{0, 4, 8});
  EXPECT_TRUE(solution.active.empty());
  EXPECT_EQ(VectorOf(solution.multipliers), Eigen::VectorXd::Zero(9));
  EXPECT_EQ(VectorOf(solution.gaps_mm), q);
}

TEST(LcpSolverTest, AllRowsMayBeActive) {
  RandomNumbers random(14);
  const Eigen::MatrixXd C = RandomCompliance(40, 0.1, &random);
  const Eigen::VectorXd l = RandomVector(40, &random).cwiseAbs().array() + 0.1;
  const Eigen::VectorXd q = -C * l;
  LcpSolver solver = SolverOf(C);
  const LcpSolution& solution = solver.Solve(NumbersOf(q));
  EXPECT_EQ(solution.active.size(), 40U);
  EXPECT_LT((VectorOf(solution.multipliers) - l).norm(), 1e-9);
}

// Rows that touch without pressing are neither open nor closed up to rounding.
TEST(LcpSolverTest, GapsOfZeroDoNotCycle) {
  RandomNumbers random(15);
  for (int trial = 0; trial < 40; ++trial) {
    const Eigen::MatrixXd C = RandomCompliance(30, 0.01, &random);
    Eigen::VectorXd l = RandomVector(30, &random).cwiseMax(0);
    for (Eigen::Index row = 0; row < 10; ++row) l[row] = 0;
    Eigen::VectorXd slack = RandomVector(30, &random).cwiseAbs();
    for (Eigen::Index row = 0; row < 30; ++row) {
      if (row < 10 || l[row] > 0) slack[row] = 0;
    }
    const Eigen::VectorXd q = slack - C * l;
    LcpSolver solver = SolverOf(C);
    const LcpSolution& solution = solver.Solve(NumbersOf(q));
    ExpectComplementary(solution, C, q);
    EXPECT_EQ(solution.method, LcpMethod::kActiveSet);
    EXPECT_LT((VectorOf(solution.multipliers) - l).norm(), 1e-7);
  }
}

// Neighbors whose gaps differ by a millionth of their motion.
TEST(LcpSolverTest, NearlyDependentRowsKeepTheirOrder) {
  RandomNumbers random(16);
  Eigen::MatrixXd rows(20, 12);
  for (Eigen::Index row = 0; row < 20; row += 2) {
    rows.row(row) = RandomVector(12, &random);
    rows.row(row + 1) = rows.row(row) + 1e-6 * RandomVector(12, &random).transpose();
  }
  const Eigen::MatrixXd C = rows * rows.transpose() + 1e-12 * Eigen::MatrixXd::Identity(20, 20);
  for (int trial = 0; trial < 40; ++trial) {
    Eigen::VectorXd q = RandomVector(20, &random);
    for (Eigen::Index row = 0; row < 20; row += 2) q[row + 1] = q[row] + 0.3 * random.Next();
    LcpSolver solver = SolverOf(C);
    const LcpSolution& solution = solver.Solve(NumbersOf(q));
    EXPECT_TRUE(solution.converged);
    EXPECT_LT(solution.kkt_residual_mm, 1e-9);
    EXPECT_GT((q + C * VectorOf(solution.multipliers)).minCoeff(), -1e-9);
  }
}

// The energy is convex, so a descent to any other admissible point would show.
TEST(LcpSolverTest, NoAdmissibleMultipliersHaveLessEnergy) {
  RandomNumbers random(17);
  const Eigen::MatrixXd C = LineCompliance(60, 5);
  const Eigen::VectorXd q = RandomVector(60, &random);
  LcpSolver solver = SolverOf(C);
  const Eigen::VectorXd l = VectorOf(solver.Solve(NumbersOf(q)).multipliers);
  const double least = EnergyOf(C, q, l);
  for (const double size : {1e-4, 1e-2, 1.0}) {
    for (int trial = 0; trial < 100; ++trial) {
      const Eigen::VectorXd other = (l + size * RandomVector(60, &random)).cwiseMax(0);
      EXPECT_GE(EnergyOf(C, q, other), least - 1e-13 * std::abs(least));
    }
  }
  const Eigen::VectorXd sticking = -C.ldlt().solve(q);
  EXPECT_GT(EnergyOf(C, q, sticking.cwiseMax(0)), least);
}

// A drag as the solver sees it: gaps that change by a little a frame, with a jump now and then.
class DraggedGaps {
 public:
  DraggedGaps(Eigen::Index rows, RandomNumbers* random)
      : random_(*random), rows_(rows), direction_(RandomVector(rows, random)) {
    Jump();
  }

  const Eigen::VectorXd& Next() {
    ++frame_;
    if (frame_ % 50 == 0) Jump();
    if (frame_ % 10 == 0) direction_ = RandomVector(rows_, &random_);
    gaps_ += 0.03 * direction_;
    return gaps_;
  }

 private:
  void Jump() { gaps_ = 2 * RandomVector(rows_, &random_); }

  RandomNumbers& random_;
  const Eigen::Index rows_;
  Eigen::VectorXd direction_;
  Eigen::VectorXd gaps_;
  int frame_ = 0;
};

TEST(LcpSolverTest, AnswersDoNotDependOnTheDragBefore) {
  RandomNumbers random(18);
  const Eigen::MatrixXd C = LineCompliance(120, 4);
  LcpSolver warm = SolverOf(C);
  DraggedGaps drag(120, &random);
  for (int frame = 0; frame < 1200; ++frame) {
    const Eigen::VectorXd& q = drag.Next();
    const LcpSolution& dragged = warm.Solve(NumbersOf(q));
    LcpSolver cold = SolverOf(C);
    const LcpSolution& single = cold.Solve(NumbersOf(q));
    ASSERT_TRUE(dragged.converged);
    ASSERT_LT(dragged.kkt_residual_mm, 1e-11);
    ASSERT_EQ(dragged.active, single.active) << frame;
    ASSERT_EQ(dragged.multipliers, single.multipliers) << frame;
    ASSERT_EQ(dragged.gaps_mm, single.gaps_mm) << frame;
  }
}

TEST(LcpSolverTest, AWarmStartTakesFewerSteps) {
  RandomNumbers random(19);
  const Eigen::MatrixXd C = LineCompliance(120, 4);
  const Eigen::VectorXd q = RandomVector(120, &random);
  LcpSolver solver = SolverOf(C);
  EXPECT_GT(solver.Solve(NumbersOf(q)).active_set_steps, 2);
  const Eigen::VectorXd close = q + 1e-9 * RandomVector(120, &random);
  EXPECT_EQ(solver.Solve(NumbersOf(close)).active_set_steps, 1);
}

TEST(LcpSolverTest, GaussSeidelGivesTheSameAnswerToTheLastBit) {
  RandomNumbers random(20);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::MatrixXd C = LineCompliance(50, 3);
    const Eigen::VectorXd q = RandomVector(50, &random);
    LcpSolver active_set = SolverOf(C);
    LcpSolver sweeps = SolverOf(C, {.max_active_set_steps = 0});
    const LcpSolution& expected = active_set.Solve(NumbersOf(q));
    const LcpSolution& swept = sweeps.SolveFrom(NumbersOf(q), std::vector<int32_t>{1, 2, 3});
    EXPECT_TRUE(swept.converged);
    EXPECT_EQ(swept.method, LcpMethod::kGaussSeidel);
    EXPECT_GT(swept.sweeps, 0);
    EXPECT_EQ(swept.active, expected.active);
    EXPECT_EQ(swept.multipliers, expected.multipliers);
  }
}

TEST(LcpSolverTest, ReportsWhenItsStepLimitsAreExhausted) {
  RandomNumbers random(21);
  const Eigen::MatrixXd C = LineCompliance(80, 40);
  const Eigen::VectorXd q = RandomVector(80, &random);
  LcpSolver solver = SolverOf(C, {.max_active_set_steps = 1, .max_sweeps = 3});
  const LcpSolution& solution = solver.Solve(NumbersOf(q));
  EXPECT_FALSE(solution.converged);
  EXPECT_EQ(solution.active_set_steps, 1);
  EXPECT_EQ(solution.sweeps, 3);
  EXPECT_GT(solution.kkt_residual_mm, 1e-6);
  EXPECT_GE(VectorOf(solution.multipliers).minCoeff(), 0.0);
}

TEST(LcpSolverTest, GapsThatAreNotNumbersDoNotConverge) {
  const Eigen::MatrixXd C = LineCompliance(5, 2);
  const std::vector<double> q = {1, std::nan(""), -1, 2, -2};
  LcpSolver solver = SolverOf(C);
  EXPECT_FALSE(solver.Solve(q).converged);
  // The solver is usable afterwards.
  EXPECT_TRUE(solver.Solve(std::vector<double>{1, -1, -1, 2, -2}).converged);
}

TEST(LcpSolverTest, NoRowsAreSolvedAtOnce) {
  LcpSolver solver({}, 0);
  const LcpSolution& solution = solver.Solve({});
  EXPECT_TRUE(solution.converged);
  EXPECT_EQ(solution.kkt_residual_mm, 0.0);
}

TEST(LcpSolverTest, KeepsItsMemory) {
  RandomNumbers random(22);
  const Eigen::MatrixXd C = LineCompliance(70, 4);
  LcpSolver solver = SolverOf(C);
  const LcpSolution& solution = solver.Solve(NumbersOf(RandomVector(70, &random)));
  const double* const multipliers = solution.multipliers.data();
  const double* const gaps = solution.gaps_mm.data();
  for (int frame = 0; frame < 50; ++frame) {
    const Eigen::VectorXd q = RandomVector(70, &random);
    solver.Solve(NumbersOf(q));
    EXPECT_EQ(solution.multipliers.data(), multipliers);
    EXPECT_EQ(solution.gaps_mm.data(), gaps);
    EXPECT_EQ(solution.active.capacity(), 70U);
  }
}

}  // namespace
}  // namespace tissueform
