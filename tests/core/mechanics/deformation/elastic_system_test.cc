// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/elastic_system.h"

#include "gtest/gtest.h"
#include <Eigen/Eigenvalues>

#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BoundaryError;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::Pose;
using testing::PrepareBar;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

absl::StatusOr<std::unique_ptr<ElasticSystem>> CreateSystem(const ElasticSystemOptions& options) {
  const auto preparation = PrepareBar().value();
  return ElasticSystem::Create(preparation->mesh(), preparation->stiffness(),
                               preparation->constraints(), options);
}

TEST(ElasticSystemTest, CoefficientsMoveTheHandlesAsThePosesDo) {
  const auto preparation = PrepareBar({}, 2).value();
  const ElasticSystem& elastic = **preparation->Elastic();
  const std::vector<HandlePose> poses = {Pose({0.5, -2, 1}, {1, 2, 3}, 1.4),
                                         Pose({3, 1, 0}, {0, -2, 1}, 0.7)};
  const Eigen::VectorXd displacements = elastic.response_columns() * elastic.Coefficients(poses);
  const Positions positions =
      preparation->mesh().positions() +
      Eigen::Map<const Positions>(displacements.data(), preparation->mesh().num_vertices(), 3);
  EXPECT_LT(BoundaryError(*preparation, poses[0], 0, positions), 1e-12);
  EXPECT_LT(BoundaryError(*preparation, poses[1], 1, positions), 1e-12);
}

TEST(ElasticSystemTest, PoissonRatioOutsideItsRangeIsRefused) {
  for (const double nu : {-0.01, 0.5, 0.6}) {
    EXPECT_THAT(CreateSystem({.poisson_ratio = nu, .admission = {}}),
                StatusIs(kInvalid, HasSubstr("Poisson's ratio")));
  }
}

TEST(ElasticSystemTest, NearlyIncompressibleIsRefusedWithTheConditionEstimate) {
  EXPECT_THAT(CreateSystem({.poisson_ratio = 0.49999999999, .admission = {}}),
              StatusIs(kInvalid, HasSubstr("condition estimate")));
}

TEST(ElasticSystemTest, ConditionEstimateComesCloseToTheTruth) {
  const auto preparation = PrepareBar().value();
  const ElasticSystem& elastic = **preparation->Elastic();
  const SparseMatrix K =
      ElasticStiffness(preparation->elements(), preparation->vertex_cells(),
                       preparation->stiffness(), preparation->options().poisson_ratio, 1);
  const auto& unknowns = elastic.system().free();
  const Eigen::MatrixXd A = Eigen::MatrixXd(K)(unknowns, unknowns);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(A, Eigen::EigenvaluesOnly);
  const double truth = solver.eigenvalues().maxCoeff() / solver.eigenvalues().minCoeff();
  EXPECT_LT(elastic.condition_estimate(), 1.001 * truth);
  EXPECT_GT(elastic.condition_estimate(), 0.3 * truth);
}

TEST(ElasticSystemTest, AdmissionIsAskedForTheFactorAndThenForTheColumns) {
  std::vector<int64_t> asked;
  const auto note = [&asked](int64_t bytes) {
    asked.push_back(bytes);
    return absl::OkStatus();
  };
  const auto elastic = CreateSystem({.poisson_ratio = 0.45, .admission = note});
  ASSERT_THAT(elastic, IsOk());
  ASSERT_EQ(asked.size(), 2u);
  EXPECT_EQ(asked[0], (*elastic)->system().factorization().factor_bytes);
  EXPECT_EQ(asked[1], (*elastic)->response_columns().size() * 8);
  EXPECT_GE((*elastic)->bytes_held(), asked[0] + asked[1]);
}

TEST(ElasticSystemTest, ReturnsTheRefusalOfTheAdmission) {
  for (const int allowed : {0, 1}) {
    int calls = 0;
    const auto refuse = [&calls, allowed](int64_t) {
      return calls++ < allowed ? absl::OkStatus() : absl::ResourceExhaustedError("no room");
    };
    EXPECT_THAT(CreateSystem({.poisson_ratio = 0.45, .admission = refuse}),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("no room")));
  }
}

}  // namespace
}  // namespace tissueform
