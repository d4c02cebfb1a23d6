// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/outcome.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "tests/core/planning/outcome/simulated_patient.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::BundledHead;
using testing::ExpectErrorsByRegion;
using testing::ExpectMovements;
using ::testing::HasSubstr;
using testing::MissedPlan;
using testing::OperatedHead;
using testing::PreOperativeHead;
using testing::RandomMove;
using testing::StatusIs;

// A simulated patient: the surgeon missed the plan, tissue is another law with other stiffness, and
// the head lies otherwise in the scanner.
class SimulatedPatientTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    SetBlasThreads(1);
    head = new PreOperativeHead(BundledHead("three_segments"));
  }
  static void TearDownTestSuite() {
    delete head;
    head = nullptr;
  }

  absl::StatusOr<Outcome> Compare(const PostOperativeHead& post, bool accept = false) const {
    return CompareOutcome(
        head->problem, head->contents, post,
        {.models = {DeformationModel::kLinearElastic}, .threads = 2, .accept_findings = accept});
  }

  static PreOperativeHead* head;
  std::mt19937 random_{34};
};

PreOperativeHead* SimulatedPatientTest::head = nullptr;

TEST_F(SimulatedPatientTest, TheTrueMovementAndTheModelsErrorAreRecovered) {
  const std::vector<HandlePose> real = MissedPlan(*head, &random_);
  const RigidMove position = RandomMove(&random_, 12, 15);
  const PostOperativeHead post =
      OperatedHead(*head, real, {.stiffer = 3, .position = position}, &random_);
  ASSERT_OK_AND_ASSIGN(const Outcome outcome, Compare(post));
  // The error that was given: the same two models by the same true movement, in one position.
  std::mt19937 unused(1);
  const PostOperativeHead truth = OperatedHead(*head, real, {.stiffer = 3, .noise_mm = 0}, &unused);

  ASSERT_EQ(outcome.segments.size(), 3U);
  ExpectMovements(outcome, real);
  ExpectErrorsByRegion(outcome, truth.skin);
  const ComparedPrediction& predicted = outcome.predictions.front();
  ASSERT_EQ(predicted.regions.size(), 7U);
  for (const RegionComparison& region : predicted.regions) {
    EXPECT_GT(region.compared_share, 0.95) << region.region;
  }
  // The operated movement predicts better than nothing.
  EXPECT_LT(predicted.regions.back().predicted_to_real.mean_absolute_mm,
            0.3 * outcome.predictions.back().regions.back().predicted_to_real.mean_absolute_mm);
  EXPECT_EQ(outcome.predictions.back().movement, "none");
}

TEST_F(SimulatedPatientTest, APhotographIsComparedByThePlan) {
  std::vector<HandlePose> planned;
  for (const CaseHandle& handle : head->contents.handles) planned.push_back(handle.pose);
  PostOperativeHead post = OperatedHead(
      *head, planned, {.stiffer = 3, .position = RandomMove(&random_, 10, 10)}, &random_);
  post.bone.reset();
  ASSERT_OK_AND_ASSIGN(const Outcome outcome, Compare(post));
  EXPECT_FALSE(outcome.by_bone);
  EXPECT_FALSE(outcome.segments.front().measured);
  EXPECT_EQ(outcome.predictions.front().movement, "planned");
  EXPECT_LT(outcome.predictions.front().regions.back().predicted_to_real.mean_absolute_mm, 0.6);
}

TEST_F(SimulatedPatientTest, BadScansAreRefusedWithTheReason) {
  std::mt19937 random(5);
  const std::vector<HandlePose> rest(3);
  const PostOperativeHead same = OperatedHead(*head, rest, {.noise_mm = 0}, &random);
  EXPECT_THAT(Compare(same).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("nothing has moved")));

  const PostOperativeHead post = OperatedHead(*head, MissedPlan(*head, &random_), {}, &random);
  const auto scaled = [](const TriangleMesh& mesh, const Eigen::Vector3d& factors) {
    TriangleIndices triangles = mesh.triangles();
    if (factors.prod() < 0) triangles.col(1).swap(triangles.col(2));
    return *TriangleMesh::Create(mesh.positions() * factors.asDiagonal(), triangles);
  };
  const auto status_of = [&](const Eigen::Vector3d& factors) {
    return Compare({scaled(post.skin, factors), scaled(*post.bone, factors)}).status();
  };
  EXPECT_THAT(status_of({1e-3, 1e-3, 1e-3}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("meters")));
  EXPECT_THAT(status_of({-1, -1, 1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("RAS")));
  EXPECT_THAT(status_of({-1, 1, 1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mirror image")));
  EXPECT_THAT(status_of({1.12, 0.9, 1}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another patient")));
}

TEST_F(SimulatedPatientTest, ASegmentThatWasNotScannedIsRefused) {
  std::mt19937 random(9);
  PostOperativeHead post = OperatedHead(*head, MissedPlan(*head, &random_), {}, &random);
  std::vector<Eigen::Index> seen;
  const TriangleMesh& bone = *post.bone;
  for (Eigen::Index t = 0; t < bone.num_triangles(); ++t) {
    const bool low = bone.positions()(bone.triangles()(t, 0), 2) < -98;
    const bool in_front = bone.positions()(bone.triangles()(t, 0), 1) < 100;
    if (!low || !in_front) seen.push_back(t);
  }
  post.bone = *TriangleMesh::Create(bone.positions(), bone.triangles()(seen, Eigen::all));
  EXPECT_THAT(Compare(post).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("was not found in the post-operative bone")));
}

TEST_F(SimulatedPatientTest, AnOpenedMouthIsRecognized) {
  std::vector<HandlePose> opened;
  const Eigen::Vector3d middle(-97, 105, -34.5);
  RigidMove hinge;
  const double angle = 14 * EIGEN_PI / 180;
  hinge.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
  hinge.translation_mm = middle - hinge.rotation * middle;
  for (const CaseHandle& handle : head->contents.handles) {
    const RigidMove planned = MoveOf(handle.pose);
    opened.push_back(
        PoseOf(handle.name == "maxilla" ? planned : Composed(hinge, planned), handle.pivot_mm));
  }
  std::mt19937 random(6);
  const PostOperativeHead post =
      OperatedHead(*head, opened, {.model = DeformationModel::kLinearElastic}, &random);
  EXPECT_THAT(Compare(post).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("open mouth")));
  ASSERT_OK_AND_ASSIGN(const Outcome accepted, Compare(post, true));
  ASSERT_TRUE(accepted.opening.has_value());
  EXPECT_NEAR(accepted.opening->degrees, 14, 0.5);
  EXPECT_THAT(accepted.cautions, ::testing::Not(::testing::IsEmpty()));
}

TEST_F(SimulatedPatientTest, SwellingIsRecognized) {
  std::mt19937 random(8);
  std::vector<HandlePose> planned;
  for (const CaseHandle& handle : head->contents.handles) planned.push_back(handle.pose);
  PostOperativeHead post = OperatedHead(*head, planned, {.noise_mm = 0}, &random);
  // Everything in front of the ears and below the eyes stands out by 4 mm more.
  Positions positions = post.skin.positions();
  const Eigen::RowVector3d inside(-97, 100, -90);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    if (positions(v, 2) > -45 || positions(v, 1) > 100) continue;
    positions.row(v) += 4 * (positions.row(v) - inside).normalized();
  }
  post.skin = *TriangleMesh::Create(positions, post.skin.triangles());
  EXPECT_THAT(Compare(post).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("swollen")));
}

}  // namespace
}  // namespace tissueform
