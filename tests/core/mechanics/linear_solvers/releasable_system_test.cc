// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/linear_solvers/releasable_system.h"

#include <algorithm>
#include <numeric>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/operators/laplacian.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

SparseMatrix BarLaplacian() {
  const TetMesh bar = testing::Bar({4, 4, 6}, 1.0, 0.2);
  return CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()));
}

// All but those that `gone` holds.
std::vector<int32_t> Without(std::vector<int32_t> all, const std::vector<int32_t>& gone) {
  const auto is_gone = [&gone](int32_t i) {
    return std::find(gone.begin(), gone.end(), i) != gone.end();
  };
  all.erase(std::remove_if(all.begin(), all.end(), is_gone), all.end());
  return all;
}

TEST(ReleasableSystemTest, AnswersLikeAFactorWithoutTheReleasedUnknowns) {
  const SparseMatrix K = BarLaplacian();
  std::vector<int32_t> all(75);  // three layers of the bar, neighbours of each other
  std::iota(all.begin(), all.end(), 0);
  std::vector<int32_t> many(40);
  std::iota(many.begin(), many.end(), 30);
  const Eigen::MatrixXd rhs = Eigen::MatrixXd::Random(K.rows(), 3);
  ASSERT_OK_AND_ASSIGN(const auto releasable, ReleasableSystem::Create(K, all, {}));
  std::vector<int32_t> prescribed = all;
  for (const std::vector<int32_t>& gone : {std::vector<int32_t>{}, {12}, {3, 13, 74}, {}, many}) {
    prescribed = Without(prescribed, gone);
    const auto num = static_cast<Eigen::Index>(prescribed.size());
    const Eigen::MatrixXd values = Eigen::MatrixXd::Random(num, 3);
    ASSERT_THAT(releasable->KeepOnly(prescribed), IsOk());
    EXPECT_EQ(releasable->num_prescribed(), num);
    EXPECT_EQ(releasable->num_released(), 75 - num);
    ASSERT_OK_AND_ASSIGN(const auto anew, DirichletSystem::Create(K, prescribed, {}));
    for (const Eigen::MatrixXd& right : {rhs, Eigen::MatrixXd()}) {
      ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd expected, anew->Solve(right, values));
      ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd found, releasable->Solve(right, values));
      EXPECT_LT((found - expected).norm(), 1e-11 * expected.norm());
      EXPECT_EQ(found(prescribed, Eigen::all), values);
    }
  }
}

TEST(ReleasableSystemTest, ReleasedUnknownsCannotBeHeldAgain) {
  ASSERT_OK_AND_ASSIGN(const auto system, ReleasableSystem::Create(BarLaplacian(), {3, 5, 9}, {}));
  EXPECT_THAT(system->KeepOnly({3, 4, 9}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("unknown 4")));
  EXPECT_THAT(system->KeepOnly({9, 3}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("unknown")));
  EXPECT_EQ(system->num_released(), 0);
  ASSERT_THAT(system->KeepOnly({3, 9}), IsOk());
  EXPECT_THAT(system->KeepOnly({3, 5}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("unknown 5")));
}

TEST(ReleasableSystemTest, ReleasingTooMuchIsRefused) {
  // Positive definite only while its first unknown is held.
  SparseMatrix K(3, 3);
  for (const auto& [i, j, k] : {std::tuple{0, 0, 0.5},
                                {0, 1, -1.0},
                                {1, 0, -1.0},
                                {1, 1, 2.0},
                                {1, 2, -1.0},
                                {2, 1, -1.0},
                                {2, 2, 1.0}}) {
    K.insert(i, j) = k;
  }
  K.makeCompressed();
  ASSERT_OK_AND_ASSIGN(const auto system, ReleasableSystem::Create(K, {0}, {}));
  EXPECT_THAT(system->KeepOnly({}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not positive definite")));
}

}  // namespace
}  // namespace tissueform
