// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_problem.h"

#include <limits>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::kInvalid;
using testing::StatusIs;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<double, 2> kSome = {-1, 1};

// A bar of 8 x 8 x 16 mm with two handles at its top.
class FitProblemTest : public ::testing::Test {
 protected:
  FitProblemTest()
      : mesh_(testing::Bar({4, 4, 8}, 2.0)), constraints_(testing::StackedHandles(mesh_, 2)) {
    request_.targets = {{.name = "side",
                         .point_mm = Vector3d(0, 4, 8),
                         .direction = Vector3d(0, -2, 0),
                         .movement_mm = 1}};
    request_.moving = {{.handle = "handle 0", .rotation = {kSome}, .translation = {kSome, kSome}}};
  }

  absl::StatusOr<FitProblem> Resolve() const {
    return ResolveFit(request_, mesh_, constraints_, std::vector<HandlePose>(2));
  }
  FitTargetRequest& target() { return request_.targets.front(); }
  FitFreedom& freedom() { return request_.moving.front(); }

  const TetMesh mesh_;
  const ConstraintSet constraints_;
  FitRequest request_;
};

TEST_F(FitProblemTest, PointGoesToTheNearestSkinAndDirectionsHaveLengthOne) {
  target().point_mm = Vector3d(-0.75, 4.5, 8.25);
  ASSERT_OK_AND_ASSIGN(const FitProblem problem, Resolve());
  const FitTarget& found = problem.targets.front();
  EXPECT_LT((found.rest_mm - Vector3d(0, 4.5, 8.25)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(found.off_skin_mm, 0.75);
  EXPECT_EQ(problem.num_equations(), 1);
  EXPECT_LT((found.along.transpose() - Vector3d(0, -1, 0)).norm(), 1e-12);
  EXPECT_EQ(UnknownName(problem, problem.unknowns[2]), "handle 0 translation_y_mm");
}

TEST_F(FitProblemTest, RasRequestIsTheSameAsItsLpsTwin) {
  target() = {.name = "side", .point_mm = Vector3d(0, 4, 8), .position_mm = Vector3d(1, 5, 9)};
  freedom().pivot_mm = Vector3d(3, 2, 16);
  ASSERT_OK_AND_ASSIGN(const FitProblem lps, Resolve());
  const Vector3d signs(-1, -1, 1);
  request_.axes = CoordinateSystem::kRas;
  target().point_mm = signs.cwiseProduct(*target().point_mm);
  target().position_mm = signs.cwiseProduct(*target().position_mm);
  freedom().pivot_mm = signs.cwiseProduct(*freedom().pivot_mm);
  ASSERT_OK_AND_ASSIGN(const FitProblem ras, Resolve());
  EXPECT_EQ(ras.targets[0].rest_mm, lps.targets[0].rest_mm);
  EXPECT_EQ(ras.targets[0].wanted_mm, lps.targets[0].wanted_mm);
  EXPECT_EQ(ras.poses[0].pivot_mm, lps.poses[0].pivot_mm);
  EXPECT_EQ(ras.unknowns[0].sign, -1);
}

// Turned and scaled about the origin, which is not the pivot that the fit chooses.
TEST_F(FitProblemTest, PoseAboutAnotherPivotIsTheSameMovement) {
  HandlePose pose{.rotation_vector = {0.1, -0.2, 0.3}, .translation_mm = {1, 2, 3}, .scale = 1.1};
  ASSERT_OK_AND_ASSIGN(const FitProblem problem,
                       ResolveFit(request_, mesh_, constraints_, std::vector(2, pose)));
  const HandlePose& moved = problem.poses[0];
  EXPECT_GT(moved.pivot_mm.z(), 12);
  for (const Vector3d& at : {Vector3d(0, 0, 0), Vector3d(5, 6, 7)}) {
    EXPECT_LT((ApplyPose(moved, at) - ApplyPose(pose, at)).norm(), 1e-12);
  }
  EXPECT_EQ(problem.poses[1].pivot_mm, Vector3d::Zero()) << "does not move";
}

TEST_F(FitProblemTest, SymmetryLeavesTurnsAboutXAndMovesAcrossIt) {
  request_.symmetric = true;
  freedom().rotation.fill(kSome);
  freedom().translation.fill(kSome);
  ASSERT_OK_AND_ASSIGN(const FitProblem problem,
                       ResolveFit(request_, mesh_, constraints_,
                                  std::vector(2, HandlePose{.rotation_vector = {0.1, 0.1, 0.1},
                                                            .translation_mm = {1, 1, 1}})));
  std::vector<std::string> names;
  for (const FitUnknown& unknown : problem.unknowns) names.push_back(UnknownName(problem, unknown));
  EXPECT_THAT(names, ::testing::ElementsAre("handle 0 rotation_x_deg", "handle 0 translation_y_mm",
                                            "handle 0 translation_z_mm"));
  EXPECT_EQ(problem.poses[0].translation_mm.x(), 0);
  EXPECT_EQ(problem.poses[0].rotation_vector.y(), 0);
  freedom().rotation = {};
  freedom().translation = {kSome};
  EXPECT_THAT(Resolve(), StatusIs(kInvalid, HasSubstr("which symmetry leaves")));
}

TEST_F(FitProblemTest, PointOffTheSkinReportsDistanceAndNearestSkin) {
  target().point_mm = Vector3d(-5.5, 4, 8);
  EXPECT_THAT(Resolve(),
              StatusIs(kInvalid, AllOf(HasSubstr("target \"side\""), HasSubstr("5.50 mm off"),
                                       HasSubstr("in the air or in bone"),
                                       HasSubstr("skin is [0.00, 4.00, 8.00]"))));
  target().point_mm = Vector3d(3, 4, 8);
  EXPECT_THAT(Resolve(),
              StatusIs(kInvalid, AllOf(HasSubstr("3.00 mm off"), HasSubstr("in the tissue"))));
  // The fixed end is held, so it is no skin.
  target().point_mm = Vector3d(4, 4, 0);
  EXPECT_THAT(Resolve(), StatusIs(kInvalid, HasSubstr("off the skin")));
}

TEST_F(FitProblemTest, BadTargetsAreNamed) {
  const auto refused = [this](auto change, const std::string& why) {
    const FitRequest sound = request_;
    change();
    EXPECT_THAT(Resolve(), StatusIs(kInvalid, HasSubstr(why)));
    request_ = sound;
  };
  refused([&] { target().weight = 0; }, "target \"side\": its weight is 0; it must be above 0");
  refused([&] { target().weight = kNan; }, "its weight is nan");
  refused([&] { target().movement_mm = kNan; }, "a number is NaN");
  refused([&] { target().point_mm = Vector3d(kNan, 0, 0); }, "a number is NaN");
  refused([&] { target().direction = Vector3d(0, 0, 0); }, "its direction has no length");
  refused([&] { target().point_mm.reset(); }, "it must have one location");
  refused([&] { target().vertices = {1}; }, "it must have one location");
  refused([&] { target().position_mm = Vector3d(0, 0, 0); }, "it must have one goal");
  refused([&] { target().direction.reset(); }, "it must have one goal");
  refused([&] { request_.targets.push_back(target()); }, "the name is not unique");
  refused([&] { request_.targets.clear(); }, "there are no targets");
  refused([&] { request_.targets.resize(257, target()); }, "at most 256");
  refused([&] { request_.tolerance_mm = kNan; }, "tolerance_mm is nan");
  refused([&] { request_.less_movement = -1; }, "less_movement is -1");
  refused(
      [&] {
        target().point_mm.reset();
        target().vertices = {1, 100000};
      },
      "vertex 100000 does not exist");
}

TEST_F(FitProblemTest, BadFreedomsAreNamed) {
  const auto refused = [this](auto change, const std::string& why) {
    const FitRequest sound = request_;
    change();
    EXPECT_THAT(Resolve(), StatusIs(kInvalid, HasSubstr(why)));
    request_ = sound;
  };
  refused([&] { freedom().handle = "nose"; },
          "free handle \"nose\": the plan has no such handle; it has handle 0, handle 1");
  refused([&] { request_.moving.push_back(freedom()); }, "it is listed twice");
  refused([&] { request_.moving.clear(); }, "no free numbers");
  refused(
      [&] {
        freedom().translation[1] = {2, -2};
      },
      "the bounds of its translation along y are reversed");
  refused([&] { freedom().translation[1] = {-2, 1001}; }, "translation along y exceed 1000 mm");
  refused([&] { freedom().rotation[0] = {kNan, 1}; }, "rotation about x is NaN or infinite");
  refused([&] { freedom().pivot_mm = Vector3d(0, kNan, 0); }, "its pivot_mm is NaN or infinite");
}

TEST_F(FitProblemTest, MoreFreedomsThanTheLimitAreRefused) {
  const auto constraints = testing::StackedHandles(testing::Bar({4, 20, 8}, 2.0), 5);
  request_.moving.clear();
  for (const HandleRegion& handle : constraints.handles()) {
    FitFreedom& all = request_.moving.emplace_back();
    all.handle = handle.name;
    all.rotation.fill(kSome);
    all.translation.fill(kSome);
  }
  const std::vector<HandlePose> poses(5);
  const TetMesh mesh = testing::Bar({4, 20, 8}, 2.0);
  EXPECT_THAT(ResolveFit(request_, mesh, constraints, poses),
              StatusIs(kInvalid, HasSubstr("30 free numbers; at most 24")));
  request_.moving.pop_back();
  EXPECT_THAT(ResolveFit(request_, mesh, constraints, poses), IsOk());
}

}  // namespace
}  // namespace tissueform
