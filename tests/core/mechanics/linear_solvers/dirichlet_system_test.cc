// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/dirichlet_system.h"

#include <numeric>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/LU>

#include "core/mesh/operators/laplacian.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

SparseMatrix BarLaplacian() {
  const TetMesh bar = testing::Bar({3, 3, 5}, 1.0, 0.2);
  return CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()));
}

// Prescribed rows replaced by x = value and everything solved densely.
Eigen::MatrixXd DenseOracle(const SparseMatrix& K, const std::vector<int32_t>& prescribed,
                            const Eigen::MatrixXd& rhs, const Eigen::MatrixXd& values) {
  Eigen::MatrixXd matrix(K);
  Eigen::MatrixXd right = rhs;
  for (size_t c = 0; c < prescribed.size(); ++c) {
    matrix.row(prescribed[c]).setZero();
    matrix(prescribed[c], prescribed[c]) = 1;
    right.row(prescribed[c]) = values.row(static_cast<Eigen::Index>(c));
  }
  return matrix.fullPivLu().solve(right);
}

TEST(DirichletSystemTest, AgreesWithADenseSolveOfTheWholeSystem) {
  const SparseMatrix K = BarLaplacian();
  const std::vector<int32_t> prescribed = {0, 3, 17, 40};
  const Eigen::MatrixXd rhs = Eigen::MatrixXd::Random(K.rows(), 3);
  const Eigen::MatrixXd values = Eigen::MatrixXd::Random(4, 3);
  for (const auto backend : {CholeskyBackend::kCholmod, CholeskyBackend::kEigen}) {
    ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(K, prescribed, {backend, {}}));
    ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd solution, system->Solve(rhs, values));
    const Eigen::MatrixXd oracle = DenseOracle(K, prescribed, rhs, values);
    EXPECT_LT((solution - oracle).norm(), 1e-11 * oracle.norm());
    EXPECT_LT(system->RelativeResidual(rhs, solution), 1e-13);
    EXPECT_GT(system->RelativeResidual(rhs, 1.01 * solution), 1e-3);
  }
}

TEST(DirichletSystemTest, AnotherMatrixOfThePatternTakesThePlaceOfTheFirst) {
  const TetMesh bar = testing::Bar({3, 3, 5}, 1.0, 0.2);
  const SparseMatrix first = CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()));
  const SparseMatrix second =
      CotangentLaplacian(bar, Eigen::VectorXd::LinSpaced(bar.num_tets(), 1, 9));
  const std::vector<int32_t> prescribed = {0, 3, 17, 40};
  const Eigen::MatrixXd rhs = Eigen::MatrixXd::Random(first.rows(), 2);
  const Eigen::MatrixXd values = Eigen::MatrixXd::Random(4, 2);
  for (const auto backend : {CholeskyBackend::kCholmod, CholeskyBackend::kEigen}) {
    ASSERT_OK_AND_ASSIGN(const auto system,
                         DirichletSystem::Create(first, prescribed, {backend, {}}));
    // One that cannot be factorised in between leaves no trace.
    const SparseMatrix negative = -first;
    EXPECT_THAT(system->Refactorize(negative), StatusIs(absl::StatusCode::kFailedPrecondition,
                                                        HasSubstr("not positive definite")));
    ASSERT_THAT(system->Refactorize(second), IsOk());
    ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd solution, system->Solve(rhs, values));
    const Eigen::MatrixXd oracle = DenseOracle(second, prescribed, rhs, values);
    EXPECT_LT((solution - oracle).norm(), 1e-11 * oracle.norm());
  }
}

TEST(DirichletSystemTest, AMatrixOfAnotherPatternIsRefused) {
  const SparseMatrix K = BarLaplacian();
  const TetMesh larger = testing::Bar({3, 3, 6});
  ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(K, {5, 50}, {}));
  EXPECT_THAT(
      system->Refactorize(CotangentLaplacian(larger, Eigen::VectorXd::Ones(larger.num_tets()))),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("entries")));
}

TEST(DirichletSystemTest, EmptyRightHandSideStandsForZero) {
  const SparseMatrix K = BarLaplacian();
  const Eigen::MatrixXd values = Eigen::MatrixXd::Random(2, 2);
  ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(K, {5, 50}, {}));
  ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd implicit, system->Solve({}, values));
  ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd explicit_zero,
                       system->Solve(Eigen::MatrixXd::Zero(K.rows(), 2), values));
  EXPECT_EQ(implicit, explicit_zero);
}

TEST(DirichletSystemTest, UnknownsWithoutEntriesKeepZero) {
  SparseMatrix K(4, 4);
  K.insert(0, 0) = 2;
  K.insert(2, 2) = 4;
  K.makeCompressed();
  ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(K, {3}, {}));
  EXPECT_EQ(system->num_free(), 2);
  const Eigen::MatrixXd values = Eigen::MatrixXd::Constant(1, 1, 7);
  ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd solution,
                       system->Solve(Eigen::MatrixXd::Ones(4, 1), values));
  EXPECT_LT((solution - Eigen::Vector4d(0.5, 0, 0.25, 7)).norm(), 1e-15);
  EXPECT_EQ(solution(1, 0), 0);
}

TEST(DirichletSystemTest, SolvesWithoutAFactorIfEverythingIsPrescribed) {
  const SparseMatrix K = BarLaplacian();
  std::vector<int32_t> all(K.rows());
  std::iota(all.begin(), all.end(), 0);
  ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(K, all, {}));
  const Eigen::MatrixXd values = Eigen::MatrixXd::Random(K.rows(), 1);
  ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd solution, system->Solve({}, values));
  EXPECT_EQ(solution, values);
}

TEST(DirichletSystemTest, NothingPrescribedOnALaplacianIsSingular) {
  EXPECT_THAT(DirichletSystem::Create(BarLaplacian(), {}, {CholeskyBackend::kEigen, {}}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("positive definite")));
}

TEST(DirichletSystemTest, AdmissionSeesTheBytesAndMayRefuse) {
  int64_t announced = 0;
  DirichletSystem::Options options;
  options.admission = [&](int64_t bytes) {
    announced = bytes;
    return absl::ResourceExhaustedError("budget is 1 KiB");
  };
  EXPECT_THAT(DirichletSystem::Create(BarLaplacian(), {0}, options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("budget is 1 KiB")));
  options.admission = {};
  ASSERT_OK_AND_ASSIGN(const auto system, DirichletSystem::Create(BarLaplacian(), {0}, options));
  EXPECT_EQ(system->factorization().factor_bytes, announced);
  EXPECT_GE(system->bytes_held(), announced);
}

TEST(DirichletSystemTest, PrescribedUnknownsMustExistAndRise) {
  for (const std::vector<int32_t>& bad : {std::vector<int32_t>{-1}, {96}, {4, 4}, {7, 3}}) {
    EXPECT_THAT(DirichletSystem::Create(BarLaplacian(), bad, {}),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prescribed unknown")));
  }
}

}  // namespace
}  // namespace tissueform
