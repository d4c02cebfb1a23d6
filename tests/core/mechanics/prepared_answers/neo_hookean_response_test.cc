// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/neo_hookean_response.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/percentiles.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::LargestDistance;
using testing::RandomNumbers;
using testing::StatusIs;
using ::tissueform::testing::kInvalid;

constexpr double kDegree = std::numbers::pi / 180;

TetMesh JitteredBar() { return testing::Bar({4, 4, 8}, 2.0, 0.2); }

// A bar with handles, its prepared answers at all vertices and its converged ones.
struct Prepared {
  explicit Prepared(int num_handles, double tolerance = 1e-7, double columns_mm = 1e-6)
      : mesh(JitteredBar()),
        preparation(testing::PrepareMesh(mesh, num_handles)),
        direct(*CreateNeoHookeanDeformer(preparation, {.tolerance = tolerance})),
        response(*CreateNeoHookeanResponse(preparation, testing::AllVertices(mesh),
                                           {.tolerance_mm = columns_mm, .max_estimate_mm = 100})) {}

  // Handles turned about their middle and moved, `size` times 10 degrees and 1 mm, which is what
  // 7 mm are to a head.
  std::vector<HandlePose> Poses(double size, RandomNumbers* random) const {
    std::vector<HandlePose> poses;
    for (const HandleRegion& handle : preparation->constraints().handles()) {
      HandlePose& pose = poses.emplace_back();
      pose.pivot_mm = mesh.positions()(handle.vertices, Eigen::all).colwise().mean();
      pose.rotation_vector = size * 10 * kDegree * random->Vector().normalized();
      pose.translation_mm = size * random->Vector().normalized();
    }
    return poses;
  }

  double ErrorMm(const std::vector<HandlePose>& poses) const {
    FloatPositions answer;
    response->Evaluate(poses, &answer);
    const Deformation converged = *direct->Deform(poses);
    EXPECT_TRUE(converged.summary.converged);
    return LargestDistance(answer, converged.positions);
  }

  TetMesh mesh;
  std::shared_ptr<MeshPreparation> preparation;
  std::unique_ptr<Deformer> direct;
  std::unique_ptr<VertexResponse> response;
};

class NeoHookeanResponseTest : public ::testing::TestWithParam<int> {
 protected:
  RandomNumbers random_{11};
};

// What is left out is of third order: half the pose, an eighth of the error; with one handle, whose
// third order is there, of fourth: a sixteenth. The linear answer's falls to a quarter only.
TEST_P(NeoHookeanResponseTest, ErrorIsOfTheOrderAfterTheLast) {
  const bool third_order = GetParam() == 1;
  Prepared prepared(GetParam(), 1e-9);
  ASSERT_OK_AND_ASSIGN(const auto linear, CreateLinearElasticDeformer(prepared.preparation));
  for (int sample = 0; sample < 4; ++sample) {
    const std::vector<HandlePose> poses = prepared.Poses(third_order ? 0.6 : 0.25, &random_);
    std::vector<HandlePose> half = poses;
    for (HandlePose& pose : half) pose = PartOfPose(pose, 0.5);
    const double error = prepared.ErrorMm(poses);
    EXPECT_NEAR(error / prepared.ErrorMm(half), third_order ? 16 : 8, third_order ? 3 : 1.5)
        << sample;
    ASSERT_OK_AND_ASSIGN(const Deformation of_linear, linear->Deform(poses));
    const Positions converged = prepared.direct->Deform(poses)->positions;
    EXPECT_LT(error, 0.3 * (of_linear.positions - converged).rowwise().norm().maxCoeff());
  }
}

TEST_P(NeoHookeanResponseTest, IdentityGivesRestAndHandlesGoWhereTheirPosesSay) {
  Prepared prepared(GetParam());
  FloatPositions answer;
  prepared.response->Evaluate(std::vector<HandlePose>(GetParam()), &answer);
  EXPECT_EQ(answer, prepared.mesh.positions().cast<float>());
  const std::vector<HandlePose> poses = prepared.Poses(2, &random_);
  prepared.response->Evaluate(poses, &answer);
  const ConstraintSet& constraints = prepared.preparation->constraints();
  for (size_t h = 0; h < poses.size(); ++h) {
    for (const int32_t v : constraints.handles()[h].vertices) {
      const Eigen::Vector3d expected =
          ApplyPose(poses[h], prepared.mesh.positions().row(v).transpose());
      EXPECT_LT((answer.row(v).transpose().cast<double>() - expected).norm(), 1e-4);
    }
  }
}

// Checked over 1,000 random poses: an estimate, so it may be exceeded, in one of a hundred.
TEST_P(NeoHookeanResponseTest, EstimateIsSeldomExceeded) {
  Prepared prepared(GetParam(), 1e-4, 1e-4);
  int exceeded = 0;
  double worst = 0;
  std::vector<double> estimates;  // in units of the error
  // Three handles leave a third of a millimetre between two: farther poses do not converge.
  const double size = GetParam() == 3 ? 0.5 : 1;
  for (int sample = 0; sample < 1000; ++sample) {
    const std::vector<HandlePose> poses =
        prepared.Poses(size * (0.2 + 0.8 * std::abs(random_.Next())), &random_);
    const double error = prepared.ErrorMm(poses);
    const double estimate = prepared.response->ErrorBoundMm(poses);
    exceeded += error > estimate ? 1 : 0;
    worst = std::max(worst, error / estimate);
    estimates.push_back(estimate / error);
  }
  RecordProperty("exceeded", exceeded);
  RecordProperty("median", std::to_string(Percentile(estimates, 50)));
  EXPECT_LE(exceeded, 10);
  EXPECT_LT(worst, 2);
  EXPECT_LT(Percentile(estimates, 50), 8) << "an estimate that is far too large says nothing";
}

// Over 1,000 random poses, most of them none that the cut was judged by: what the answer of few
// columns and digits lies from that of all is what the estimate has been raised by.
TEST_P(NeoHookeanResponseTest, CompressionErrorStaysWithinItsEstimate) {
  const Prepared fine(GetParam());
  // With one handle these few vertices need all triples at 0.002, and what large poses are put off
  // by counts.
  const double tolerance_mm = GetParam() == 1 ? 0.02 : 0.002;
  const double size = GetParam() == 1 ? 2 : 1;
  ASSERT_OK_AND_ASSIGN(
      const auto coarse,
      CreateNeoHookeanResponse(fine.preparation, testing::AllVertices(fine.mesh),
                               {.tolerance_mm = tolerance_mm, .max_estimate_mm = 100}));
  EXPECT_LT(coarse->num_terms(), fine.response->num_terms());
  EXPECT_LT(coarse->bytes_held(), fine.response->bytes_held());
  FloatPositions answer;
  FloatPositions of_all;
  int exceeded = 0;
  double tightest = 1e9;
  for (int sample = 0; sample < 1000; ++sample) {
    const std::vector<HandlePose> poses = fine.Poses(size * std::abs(random_.Next()), &random_);
    coarse->Evaluate(poses, &answer);
    fine.response->Evaluate(poses, &of_all);
    const double off = LargestDistance(answer, of_all.cast<double>());
    const double said = coarse->ErrorBoundMm(poses) - fine.response->ErrorBoundMm(poses);
    exceeded += off > said + 1e-5 ? 1 : 0;
    tightest = std::min(tightest, said / off);
  }
  EXPECT_LE(exceeded, 10);
  EXPECT_LT(tightest, 6) << "what is said is far too large for every pose";
}

INSTANTIATE_TEST_SUITE_P(Handles, NeoHookeanResponseTest, ::testing::Values(1, 2, 3),
                         [](const auto& test) { return "With" + std::to_string(test.param); });

TEST(NeoHookeanResponseCoverTest, CoversItsRangeButNoScaling) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 1);
  ASSERT_OK_AND_ASSIGN(const auto response,
                       CreateNeoHookeanResponse(preparation, {1, 5, 100},
                                                {.max_rotation_rad = 0.3, .max_estimate_mm = 50}));
  EXPECT_TRUE(response->error_is_estimate());
  EXPECT_EQ(response->num_terms_before(), 12 + 21 + 56);
  EXPECT_LT(response->num_terms(), 12 + 21);
  EXPECT_LT(response->bytes_held(), NeoHookeanResponseBytes(*preparation, 3));
  std::vector<HandlePose> poses(1);
  EXPECT_TRUE(response->Covers(poses));
  EXPECT_LT(response->ErrorBoundMm(poses), 1e-5) << "rest is exact";
  poses[0].rotation_vector.z() = 0.3;
  EXPECT_TRUE(response->Covers(poses));
  poses[0].rotation_vector.z() = 0.301;
  EXPECT_FALSE(response->Covers(poses));
  poses[0] = {};
  poses[0].scale = 1.01;
  EXPECT_FALSE(response->Covers(poses));
  // Within the range of turns, but so far that the series says nothing.
  poses[0] = {};
  poses[0].translation_mm.x() = 1000;
  EXPECT_FALSE(response->Covers(poses));
  FloatPositions positions;
  EXPECT_FALSE(response->Answer(poses, &positions).has_value());
}

// Where single triples say least of what is left out: nearly all of it is of even order.
TEST(NeoHookeanResponseEstimateTest, HoldsWhereASlenderBarIsTwisted) {
  const TetMesh mesh = testing::Bar({3, 3, 18}, 1.0);
  const auto preparation = testing::PrepareMesh(mesh, 1);
  ASSERT_OK_AND_ASSIGN(const auto response,
                       CreateNeoHookeanResponse(preparation, testing::AllVertices(mesh), {}));
  ASSERT_OK_AND_ASSIGN(const auto direct, CreateNeoHookeanDeformer(preparation, {}));
  std::vector<HandlePose> poses(1);
  poses[0].pivot_mm = mesh.positions().colwise().mean().transpose();
  for (const double degrees : {10, 20, 30}) {
    poses[0].rotation_vector.z() = degrees * kDegree;
    FloatPositions answer;
    response->Evaluate(poses, &answer);
    ASSERT_OK_AND_ASSIGN(const Deformation converged, direct->Deform(poses));
    EXPECT_LT(LargestDistance(answer, converged.positions), response->ErrorBoundMm(poses))
        << degrees;
  }
}

TEST(NeoHookeanResponseErrorTest, RefusalComesBeforeAnythingIsBuiltAndOptionsAreChecked) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 1);
  NeoHookeanResponseOptions options;
  options.admission = [](int64_t) { return absl::ResourceExhaustedError("no room"); };
  EXPECT_THAT(CreateNeoHookeanResponse(preparation, {1, 2}, options),
              StatusIs(absl::StatusCode::kResourceExhausted, "no room"));
  EXPECT_FALSE(preparation->has_elastic());
  EXPECT_THAT(CreateNeoHookeanResponse(preparation, {}, {}),
              StatusIs(kInvalid, HasSubstr("at least")));
  EXPECT_THAT(CreateNeoHookeanResponse(preparation, {1}, {.max_estimate_mm = 0}),
              StatusIs(kInvalid, HasSubstr("max_estimate_mm")));
  EXPECT_THAT(CreateNeoHookeanResponse(preparation, {1}, {.tolerance_mm = -1}),
              StatusIs(kInvalid, HasSubstr("tolerance_mm")));
}

}  // namespace
}  // namespace tissueform
