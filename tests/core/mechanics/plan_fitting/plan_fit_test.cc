// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/plan_fit.h"

#include <algorithm>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::Pair;
using testing::RandomNumbers;
using testing::StatusIs;

constexpr double kDegree = std::numbers::pi / 180;

// All six numbers of every handle, within so much.
std::vector<FitFreedom> AllMay(const ConstraintSet& constraints, double degrees, double mm) {
  std::vector<FitFreedom> moving;
  for (const HandleRegion& handle : constraints.handles()) {
    FitFreedom& freedom = moving.emplace_back();
    freedom.handle = handle.name;
    freedom.rotation.fill(std::array{-degrees * kDegree, degrees * kDegree});
    freedom.translation.fill(std::array{-mm, mm});
  }
  return moving;
}

// A mesh with its model and what is asked of it.
struct Case {
  Case(const TetMesh& the_mesh, int num_handles, DeformationModel model)
      : Case(the_mesh, testing::PrepareMesh(the_mesh, num_handles), model) {}

  Case(const TetMesh& the_mesh, std::shared_ptr<MeshPreparation> of_mesh, DeformationModel model)
      : mesh(the_mesh), preparation(std::move(of_mesh)) {
    options.model = model;
    options.neo_hookean.tolerance = 1e-6;
    deformer = *CreateDeformer(preparation, options);
  }

  const ConstraintSet& constraints() const { return preparation->constraints(); }

  absl::StatusOr<PlanFit> Fit(const FitRequest& request, bool verify = true) {
    return FitFrom(std::vector<HandlePose>(constraints().handles().size()), request, verify);
  }

  absl::StatusOr<PlanFit> FitFrom(const std::vector<HandlePose>& start, const FitRequest& request,
                                  bool verify) {
    problem = *ResolveFit(request, mesh, constraints(), start);
    const auto response = CreateResponse(preparation, FitVertices(problem),
                                         {.model = options.model,
                                          .tolerance_mm = 1e-3,
                                          .max_rotation_rad = LargestFitRotation(problem)});
    return FitPlan(problem, mesh, constraints(), **response,
                   {.full_model = verify ? deformer.get() : nullptr, .cancellation = {}});
  }

  // Every skin point of so many, spread over all, is to go where these poses bring it.
  FitRequest TargetsOf(const std::vector<HandlePose>& poses, size_t count) {
    const Positions positions = deformer->Deform(poses)->positions;
    std::vector<int32_t> skin = BoundaryVertices(mesh);
    const std::vector<int32_t>& held = constraints().constrained();
    std::erase_if(skin, [&](int32_t v) { return std::binary_search(held.begin(), held.end(), v); });
    FitRequest request;
    for (size_t k = 0; k < count; ++k) {
      const int32_t v = skin[(2 * k + 1) * skin.size() / (2 * count)];
      request.targets.push_back({.name = "point " + std::to_string(k),
                                 .point_mm = Vector3d(mesh.positions().row(v)),
                                 .position_mm = Vector3d(positions.row(v))});
    }
    return request;
  }

  TetMesh mesh;
  std::shared_ptr<MeshPreparation> preparation;
  DeformerOptions options;
  std::unique_ptr<Deformer> deformer;
  FitProblem problem;
};

std::vector<HandlePose> PosesAboutMiddles(const Case& of, double degrees, double mm) {
  RandomNumbers random(8);
  std::vector<HandlePose> poses;
  for (const HandleRegion& handle : of.constraints().handles()) {
    poses.push_back({.rotation_vector = degrees * kDegree * random.Vector().normalized(),
                     .pivot_mm = of.mesh.positions()(handle.vertices, Eigen::all).colwise().mean(),
                     .translation_mm = mm * random.Vector().normalized()});
  }
  return poses;
}

void ExpectSamePoses(const std::vector<HandlePose>& found, const std::vector<HandlePose>& known) {
  ASSERT_EQ(found.size(), known.size());
  for (size_t h = 0; h < known.size(); ++h) {
    EXPECT_LT((found[h].translation_mm - known[h].translation_mm).norm(), 0.01) << h;
    EXPECT_LT((found[h].rotation_vector - known[h].rotation_vector).norm(), 0.01 * kDegree) << h;
  }
}

// Between where two answers bring a vertex of bone, at most.
double BoneDistanceMm(const Case& of, const std::vector<HandlePose>& one,
                      const std::vector<HandlePose>& other) {
  double most = 0;
  for (size_t h = 0; h < one.size(); ++h) {
    for (const int32_t v : of.constraints().handles()[h].vertices) {
      const Vector3d rest = of.mesh.positions().row(v).transpose();
      most = std::max(most, (ApplyPose(one[h], rest) - ApplyPose(other[h], rest)).norm());
    }
  }
  return most;
}

class KnownPoseTest : public ::testing::TestWithParam<std::pair<std::string, DeformationModel>> {};

TEST_P(KnownPoseTest, IsFoundAgainOnAJitteredBarWithTwoHandles) {
  Case bar(testing::Bar({4, 4, 8}, 2.0, 0.2), 2, GetParam().second);
  const std::vector<HandlePose> known = PosesAboutMiddles(bar, 6, 0.8);
  FitRequest request = bar.TargetsOf(known, 12);
  request.moving = AllMay(bar.constraints(), 15, 5);
  request.less_movement = 1e-4;
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar.Fit(request));
  ExpectSamePoses(fit.poses, known);
  EXPECT_TRUE(fit.converged);
  EXPECT_TRUE(fit.verified);
  EXPECT_TRUE(fit.model_converged);
  for (const FittedTarget& target : fit.targets) EXPECT_LT(target.missed_mm, 0.005);
  for (const FittedUnknown& unknown : fit.unknowns) {
    EXPECT_GT(unknown.determination.by_targets, 0.99);
  }
}

// A bar whose upper end is moved against a wall, which it meets in part.
TEST(PlanFitContactTest, AKnownPoseIsFoundAgainWhereTissueTouches) {
  const TetMesh mesh = testing::Bar({4, 4, 8}, 2.0);
  const auto vertices_where = [&mesh](auto is_chosen) {
    return testing::SelectVertices(mesh, [&](const Vector3d& x) { return is_chosen(x); });
  };
  std::vector<ContactRow> rows;
  for (const int32_t v :
       vertices_where([](const auto& x) { return x.x() == 0 && x.z() > 0 && x.z() < 16; })) {
    rows.push_back({.vertex = v, .normal = Vector3d::UnitX(), .gap_mm = 0.1});
  }
  const auto ends = ConstraintSet::Create(
      mesh, vertices_where([](const auto& x) { return x.z() == 0; }),
      {{"top", vertices_where([](const auto& x) { return x.z() == 16; })}}, rows);
  ASSERT_TRUE(ends.ok()) << ends.status();
  Case bar(mesh,
           *MeshPreparation::Create(mesh, Eigen::VectorXd::Constant(mesh.num_tets(), 15000.0),
                                    *ends, {}),
           DeformationModel::kLinearElastic);
  const std::vector<HandlePose> known = {{.rotation_vector = {0, 4 * kDegree, 2 * kDegree},
                                          .pivot_mm = {4, 4, 16},
                                          .translation_mm = {-0.6, 0.3, -0.4}}};
  const std::vector<double> forces = bar.deformer->Deform(known)->contact.forces;
  const auto open = std::ranges::count(forces, 0.0);
  ASSERT_GT(open, 0);
  ASSERT_LT(open, std::ssize(forces));
  FitRequest request = bar.TargetsOf(known, 12);
  request.moving = AllMay(bar.constraints(), 15, 5);
  request.less_movement = 1e-4;
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar.Fit(request));
  ExpectSamePoses(fit.poses, known);
  EXPECT_TRUE(fit.verified);
  for (const FittedTarget& target : fit.targets) EXPECT_LT(target.missed_mm, 0.005);
}

INSTANTIATE_TEST_SUITE_P(
    Models, KnownPoseTest,
    ::testing::Values(std::pair("GradientField", DeformationModel::kGradientField),
                      std::pair("LinearElastic", DeformationModel::kLinearElastic),
                      std::pair("NeoHookean", DeformationModel::kNeoHookean)),
    [](const auto& test) { return test.param.first; });

// As a user pulls: each target, which cannot be reached, a little further than the one before.
TEST_P(KnownPoseTest, APullEndsWhereASearchFromRestDoes) {
  Case bar(testing::Bar({4, 4, 8}, 2.0, 0.2), 2, GetParam().second);
  FitRequest request = bar.TargetsOf(std::vector<HandlePose>(2), 6);
  request.moving = AllMay(bar.constraints(), 15, 5);
  RandomNumbers random(4);
  std::vector<Vector3d> goals;
  for (const FitTargetRequest& target : request.targets) {
    goals.push_back(*target.position_mm + 1.5 * random.Vector());
  }
  std::vector<HandlePose> last(2);
  for (int step = 0; step < 8; ++step) {
    for (size_t t = 0; t < goals.size(); ++t) {
      Vector3d& wanted = *request.targets[t].position_mm;
      wanted += (goals[t] - wanted) / (8 - step);
    }
    ASSERT_OK_AND_ASSIGN(const PlanFit cold, bar.Fit(request, /*verify=*/false));
    ASSERT_OK_AND_ASSIGN(const PlanFit warm, bar.FitFrom(last, request, /*verify=*/false));
    EXPECT_TRUE(cold.converged && warm.converged);
    EXPECT_LT(BoneDistanceMm(bar, warm.poses, cold.poses), 0.02) << step;
    for (size_t t = 0; t < goals.size(); ++t) {
      EXPECT_LT((warm.targets[t].position_mm - cold.targets[t].position_mm).norm(), 0.005);
    }
    last = warm.poses;
  }
  EXPECT_GT(last[0].translation_mm.norm(), 0.05) << "something was pulled";
}

TEST(PlanFitTest, KnownPoseOfTheTongueIsFoundAgain) {
  Case tongue(testing::LoadTestMesh("plans/tongue/volumetricTongue.vtu"), 1,
              DeformationModel::kGradientField);
  const std::vector<HandlePose> known = PosesAboutMiddles(tongue, 12, 0.3);
  FitRequest request = tongue.TargetsOf(known, 10);
  request.moving = AllMay(tongue.constraints(), 20, 2);
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, tongue.Fit(request));
  ExpectSamePoses(fit.poses, known);
}

// The turn of a handle that is a point moves nothing: reported, and left at rest.
TEST(PlanFitTest, OneTetFollowsItsCorner) {
  const TetMesh tet = testing::SingleTet();
  const ConstraintSet constraints = *ConstraintSet::Create(tet, {0, 1}, {{"corner", {2}}});
  const auto preparation =
      *MeshPreparation::Create(tet, Eigen::VectorXd::Constant(1, 3000.0), constraints, {});
  FitRequest request;
  request.targets = {
      {.name = "free", .vertices = {3}, .displacement_mm = Vector3d(0.01, 0.02, -0.01)}};
  request.moving = AllMay(constraints, 20, 1);
  const FitProblem problem = *ResolveFit(request, tet, constraints, std::vector<HandlePose>(1));
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateLinearElasticDeformer(preparation));
  ASSERT_OK_AND_ASSIGN(
      const auto response,
      CreateResponse(preparation, FitVertices(problem),
                     {.model = DeformationModel::kLinearElastic, .tolerance_mm = 1e-4}));
  ASSERT_OK_AND_ASSIGN(const PlanFit fit,
                       FitPlan(problem, tet, constraints, *response,
                               {.full_model = deformer.get(), .cancellation = {}}));
  EXPECT_LT(fit.targets[0].missed_mm, 1e-3);
  EXPECT_LT(fit.poses[0].rotation_vector.norm(), 1e-6);
  for (int i = 0; i < 3; ++i) EXPECT_LT(fit.unknowns[i].determination.by_targets, 1e-6);
}

// A bar with a handle at its top, moved along the middle of one side.
class ShortBarTest : public ::testing::Test {
 protected:
  static FitTargetRequest Along(const std::string& name, double movement_mm,
                                const Vector3d& point = Vector3d(0, 4, 12)) {
    return {.name = name,
            .point_mm = point,
            .direction = Vector3d(1, 0, 0),
            .movement_mm = movement_mm};
  }

  Case bar_{testing::Bar({4, 4, 8}, 2.0), 1, DeformationModel::kGradientField};
  FitRequest request_{.moving = AllMay(bar_.constraints(), 25, 5)};
};

TEST_F(ShortBarTest, OneTargetMovesLeastAndReportsUndeterminedDirections) {
  request_.targets = {Along("side", 1)};
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar_.Fit(request_));
  EXPECT_LT(fit.targets[0].missed_mm, 0.005);
  // Symmetric in y, so nothing goes there.
  EXPECT_NEAR(fit.poses[0].translation_mm.y(), 0, 1e-3);
  EXPECT_GT(fit.poses[0].translation_mm.x(), 0.3);
  ASSERT_EQ(fit.directions.size(), 6);
  EXPECT_GT(fit.directions[0].by_targets, 0.99);
  for (size_t d = 1; d < 6; ++d) EXPECT_LT(fit.directions[d].by_targets, 1e-3);
  double decided = 0;
  for (const FittedUnknown& unknown : fit.unknowns) decided += unknown.determination.by_targets;
  EXPECT_NEAR(decided, 1, 1e-3) << "one number decides one";
  // A move along x alone would be larger.
  FitRequest only_x = request_;
  only_x.moving[0].rotation = {};
  only_x.moving[0].translation = {std::array{-5.0, 5.0}};
  ASSERT_OK_AND_ASSIGN(const PlanFit straight, bar_.Fit(only_x));
  EXPECT_LT(straight.targets[0].missed_mm, 0.005);
  EXPECT_LT(fit.movement_mm, straight.movement_mm);
  EXPECT_NEAR(straight.movement_mm, straight.poses[0].translation_mm.norm(), 1e-9);
}

// The slope of the answer by the target, measured by asking for 1 mm more.
TEST_F(ShortBarTest, ErrorOfAnUnknownIsItsSlopeByTheTarget) {
  request_.targets = {Along("side", 1)};
  request_.moving[0].rotation = {};
  request_.moving[0].translation = {std::array{-5.0, 5.0}};
  ASSERT_OK_AND_ASSIGN(const PlanFit one, bar_.Fit(request_));
  request_.targets = {Along("side", 2)};
  ASSERT_OK_AND_ASSIGN(const PlanFit two, bar_.Fit(request_));
  EXPECT_NEAR(two.unknowns[0].value - one.unknowns[0].value,
              one.unknowns[0].determination.error_per_mm, 1e-3);
}

TEST_F(ShortBarTest, ReportsContradictoryTargetsWithTheirMisses) {
  request_.targets = {Along("more", 3), Along("less", 1), Along("base", 0, {0, 4, 3})};
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar_.Fit(request_));
  EXPECT_THAT(fit.contradictions, ElementsAre(Pair(0, 1)));
  EXPECT_NEAR(fit.targets[0].missed_mm, 1, 0.05);
  EXPECT_NEAR(fit.targets[1].missed_mm, 1, 0.05);
  // The heavier one is missed by less.
  request_.targets[0].weight = 9;
  ASSERT_OK_AND_ASSIGN(const PlanFit weighted, bar_.Fit(request_));
  EXPECT_NEAR(weighted.targets[1].missed_mm / weighted.targets[0].missed_mm, 9, 0.5);
}

TEST_F(ShortBarTest, ReportsTheBoundThatKeepsATargetOutOfReach) {
  request_.targets = {Along("far", 9)};
  request_.moving[0].rotation = {};
  request_.moving[0].translation = {std::array{-1.0, 2.5}, std::array{-1.0, 1.0}};
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar_.Fit(request_));
  EXPECT_EQ(fit.unknowns[0].bound, ActiveBound::kUpper);
  EXPECT_EQ(fit.unknowns[0].value, 2.5);
  EXPECT_NEAR(fit.targets[0].missed_mm, 9 - fit.targets[0].reached_mm[0], 1e-9);
  EXPECT_GT(fit.targets[0].missed_mm, 6);
  EXPECT_THAT(fit.contradictions, ::testing::IsEmpty());
}

TEST_F(ShortBarTest, SymmetricHandlesStayInTheirPlane) {
  request_.targets = {
      {.name = "askew", .point_mm = Vector3d(0, 4, 12), .displacement_mm = Vector3d(1, 1, 1)}};
  request_.symmetric = true;
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar_.Fit(request_));
  EXPECT_EQ(fit.unknowns.size(), 3);
  EXPECT_EQ(fit.poses[0].translation_mm.x(), 0);
  EXPECT_EQ(fit.poses[0].rotation_vector.tail<2>(), Eigen::Vector2d::Zero());
}

TEST_F(ShortBarTest, WithoutVerificationUsesThePreparedAnswer) {
  request_.targets = {Along("side", 1)};
  ASSERT_OK_AND_ASSIGN(const PlanFit fit, bar_.Fit(request_, /*verify=*/false));
  EXPECT_FALSE(fit.verified);
  EXPECT_EQ(fit.model_answers, 0);
  const Positions there = bar_.deformer->Deform(fit.poses)->positions;
  EXPECT_LT((PositionOf(bar_.problem.targets[0].point, there) - fit.targets[0].position_mm).norm(),
            2e-3);
}

TEST_F(ShortBarTest, CancelledFitEnds) {
  request_.targets = {Along("side", 1)};
  const FitProblem problem =
      *ResolveFit(request_, bar_.mesh, bar_.constraints(), std::vector<HandlePose>(1));
  const auto response = CreateResponse(bar_.preparation, FitVertices(problem), {});
  EXPECT_THAT(FitPlan(problem, bar_.mesh, bar_.constraints(), **response,
                      {.full_model = bar_.deformer.get(),
                       .cancellation = Cancellation([] { return true; })}),
              StatusIs(absl::StatusCode::kCancelled));
}

}  // namespace
}  // namespace tissueform
