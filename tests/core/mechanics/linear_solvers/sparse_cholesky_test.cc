// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/sparse_cholesky.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Cholesky>

#include "core/mesh/operators/laplacian.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

Eigen::MatrixXd RandomMatrix(Eigen::Index rows, Eigen::Index cols) {
  std::mt19937 generator(5);
  Eigen::MatrixXd matrix(rows, cols);
  for (double& value : matrix.reshaped()) {
    value = 2.0 * generator() / 4294967295.0 - 1.0;
  }
  return matrix;
}

// Laplacian of a bar plus a small multiple of the identity: positive definite.
SparseMatrix PositiveDefinite(double shift = 0.01) {
  const TetMesh bar = testing::Bar({4, 4, 8}, 1.0, 0.2);
  SparseMatrix A = CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()));
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    A.coeffRef(i, i) += shift;
  }
  return A;
}

class SparseCholeskyTest : public ::testing::TestWithParam<CholeskyBackend> {
 protected:
  const std::unique_ptr<SparseCholesky> cholesky_ = CreateSparseCholesky(GetParam());
};

TEST_P(SparseCholeskyTest, AgreesWithADenseFactorisation) {
  const SparseMatrix A = PositiveDefinite();
  const Eigen::MatrixXd rhs = RandomMatrix(A.rows(), 3);
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  ASSERT_THAT(cholesky_->Factorize(A), IsOk());
  Eigen::MatrixXd solution;
  ASSERT_THAT(cholesky_->Solve(rhs, &solution), IsOk());
  const Eigen::MatrixXd oracle = Eigen::LDLT<Eigen::MatrixXd>(Eigen::MatrixXd(A)).solve(rhs);
  EXPECT_LT((solution - oracle).norm(), 1e-11 * oracle.norm());
}

TEST_P(SparseCholeskyTest, SolvesAgainWithAnotherNumberOfColumns) {
  const SparseMatrix A = PositiveDefinite();
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  ASSERT_THAT(cholesky_->Factorize(A), IsOk());
  for (const Eigen::Index columns : {3, 1, 12, 3}) {
    const Eigen::MatrixXd rhs = RandomMatrix(A.rows(), columns);
    Eigen::MatrixXd solution;
    ASSERT_THAT(cholesky_->Solve(rhs, &solution), IsOk());
    ASSERT_EQ(solution.cols(), columns);
    EXPECT_LT((A * solution - rhs).norm(), 1e-11 * rhs.norm());
  }
}

TEST_P(SparseCholeskyTest, SinglePrecisionComesCloseToADenseFactorisation) {
  const SparseMatrix A = PositiveDefinite();
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  ASSERT_THAT(cholesky_->Factorize(A), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto rounded, cholesky_->ToSinglePrecision());
  EXPECT_GT(cholesky_->single_precision_bytes(), cholesky_->factor_bytes() / 2);
  const Eigen::LDLT<Eigen::MatrixXd> oracle{Eigen::MatrixXd(A)};
  for (int repetition = 0; repetition < 2; ++repetition) {
    const Eigen::VectorXd rhs = RandomMatrix(A.rows(), 1);
    Eigen::VectorXf solution;
    rounded->Solve(rhs.cast<float>(), &solution);
    const Eigen::VectorXd expected = oracle.solve(rhs);
    EXPECT_LT((solution.cast<double>() - expected).norm(), 1e-5 * expected.norm());
  }
}

TEST_P(SparseCholeskyTest, SinglePrecisionRefusesPivotsOutOfItsRange) {
  const SparseMatrix A = 1e-80 * PositiveDefinite();
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  ASSERT_THAT(cholesky_->Factorize(A), IsOk());
  EXPECT_THAT(cholesky_->ToSinglePrecision(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("single precision")));
}

TEST_P(SparseCholeskyTest, OrderingByNodesGivesTheSameSolution) {
  // Two unknowns a node: the matrix twice, coupled within a node.
  const SparseMatrix one = PositiveDefinite();
  SparseMatrix A(2 * one.rows(), 2 * one.cols());
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index column = 0; column < one.cols(); ++column) {
    for (SparseMatrix::InnerIterator entry(one, column); entry; ++entry) {
      for (const auto& [i, j] : {std::pair{0, 0}, {0, 1}, {1, 0}, {1, 1}}) {
        entries.emplace_back(2 * entry.row() + i, 2 * column + j, i == j ? entry.value() : 0.0);
      }
    }
  }
  A.setFromTriplets(entries.begin(), entries.end());
  const auto by_nodes = CreateSparseCholesky(GetParam(), {.unknowns_per_node = 2});
  ASSERT_THAT(by_nodes->Analyze(A), IsOk());
  ASSERT_THAT(by_nodes->Factorize(A), IsOk());
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  const auto bytes = static_cast<double>(cholesky_->factor_bytes());
  EXPECT_NEAR(static_cast<double>(by_nodes->factor_bytes()), bytes, 0.5 * bytes);
  const Eigen::MatrixXd rhs = RandomMatrix(A.rows(), 2);
  Eigen::MatrixXd solution;
  ASSERT_THAT(by_nodes->Solve(rhs, &solution), IsOk());
  EXPECT_LT((A * solution - rhs).norm(), 1e-11 * rhs.norm());
}

TEST_P(SparseCholeskyTest, FactorisesNewValuesWithTheSameAnalysis) {
  ASSERT_THAT(cholesky_->Analyze(PositiveDefinite()), IsOk());
  for (const double shift : {0.01, 3.0}) {
    const SparseMatrix A = PositiveDefinite(shift);
    ASSERT_THAT(cholesky_->Factorize(A), IsOk());
    const Eigen::MatrixXd rhs = RandomMatrix(A.rows(), 2);
    Eigen::MatrixXd solution;
    ASSERT_THAT(cholesky_->Solve(rhs, &solution), IsOk());
    EXPECT_LT((A * solution - rhs).norm(), 1e-11 * rhs.norm());
  }
}

TEST_P(SparseCholeskyTest, BytesAreKnownBeforeTheNumericFactorAndDoNotChange) {
  const SparseMatrix A = PositiveDefinite();
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  const int64_t predicted = cholesky_->factor_bytes();
  ASSERT_THAT(cholesky_->Factorize(A), IsOk());
  EXPECT_EQ(cholesky_->factor_bytes(), predicted);
  // Not less than the lower triangle of A, not more than a dense triangle.
  EXPECT_GT(predicted, A.nonZeros() / 2 * static_cast<int64_t>(sizeof(double)));
  EXPECT_LT(predicted, 2 * A.rows() * A.rows() * static_cast<int64_t>(sizeof(double)));
}

TEST_P(SparseCholeskyTest, IndefiniteMatrixIsRefused) {
  SparseMatrix A = PositiveDefinite();
  A.coeffRef(17, 17) = -1;
  ASSERT_THAT(cholesky_->Analyze(A), IsOk());
  EXPECT_THAT(cholesky_->Factorize(A),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not positive definite")));
}

TEST_P(SparseCholeskyTest, RectangularMatrixIsRefused) {
  EXPECT_THAT(cholesky_->Analyze(SparseMatrix(3, 4)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not square")));
}

class NodeOrderTest : public ::testing::Test {
 protected:
  // Factor and solution with that order; none: with one that is looked for.
  struct Outcome {
    std::vector<int32_t> order;
    int64_t factor_bytes = 0;
    Eigen::MatrixXd solution;
  };
  Outcome SolveIn(const std::vector<int32_t>& order) const {
    const auto cholesky = CreateSparseCholesky(CholeskyBackend::kCholmod, {.node_order = order});
    Outcome outcome;
    EXPECT_THAT(cholesky->Analyze(A_), IsOk());
    outcome.order = cholesky->node_order();
    outcome.factor_bytes = cholesky->factor_bytes();
    EXPECT_THAT(cholesky->Factorize(A_), IsOk());
    EXPECT_THAT(cholesky->Solve(rhs_, &outcome.solution), IsOk());
    return outcome;
  }

  const SparseMatrix A_ = PositiveDefinite();
  const Eigen::MatrixXd rhs_ = RandomMatrix(A_.rows(), 2);
};

TEST_F(NodeOrderTest, TheOrderThatWasFoundMakesTheSameFactorAgain) {
  const Outcome found = SolveIn({});
  std::vector<int32_t> sorted = found.order;
  std::sort(sorted.begin(), sorted.end());
  std::vector<int32_t> all(A_.rows());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(sorted, all);
  const Outcome again = SolveIn(found.order);
  EXPECT_EQ(again.order, found.order);
  EXPECT_EQ(again.factor_bytes, found.factor_bytes);
  EXPECT_EQ(again.solution, found.solution) << "to the last bit";
}

TEST_F(NodeOrderTest, AnotherOrderIsObeyedAndMakesAnotherFactorOfTheSameMatrix) {
  const Outcome found = SolveIn({});
  std::vector<int32_t> shuffled = found.order;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(3));
  const Outcome other = SolveIn(shuffled);
  EXPECT_EQ(other.order, shuffled);
  EXPECT_GT(other.factor_bytes, found.factor_bytes * 3 / 2) << "fill";
  EXPECT_LT((A_ * other.solution - rhs_).norm(), 1e-11 * rhs_.norm());
}

TEST_F(NodeOrderTest, AnOrderOfAnotherNumberOfNodesIsPassedOver) {
  const Outcome found = SolveIn({});
  std::vector<int32_t> longer = found.order;
  longer.push_back(static_cast<int32_t>(A_.rows()));
  EXPECT_EQ(SolveIn(longer).order, found.order);
}

TEST_F(NodeOrderTest, RefusesAnOrderThatIsNotAPermutation) {
  std::vector<int32_t> twice = SolveIn({}).order;
  twice[1] = twice[0];
  const auto cholesky = CreateSparseCholesky(CholeskyBackend::kCholmod, {.node_order = twice});
  EXPECT_THAT(cholesky->Analyze(A_), StatusIs(absl::StatusCode::kInternal));
}

INSTANTIATE_TEST_SUITE_P(Backends, SparseCholeskyTest,
                         ::testing::Values(CholeskyBackend::kCholmod, CholeskyBackend::kEigen),
                         [](const auto& test) {
                           return test.param == CholeskyBackend::kCholmod ? "Cholmod" : "Eigen";
                         });

}  // namespace
}  // namespace tissueform
