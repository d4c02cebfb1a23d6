// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/response_basis.h"

#include <numbers>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/prepared_answers/linear_elastic_response.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::LargestDistance;
using testing::RandomNumbers;
using testing::RandomPoses;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;
// So small that no bound keeps it: all digits of the columns are read.
constexpr double kAllDigitsMm = 1e-6;
constexpr double kDegree = std::numbers::pi / 180;

TetMesh JitteredBar() { return testing::Bar({4, 6, 8}, 2.0, 0.2); }
TetMesh Tongue() { return testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"); }

// A mesh, its direct answers and its basis at all vertices.
struct Prepared {
  Prepared(const TetMesh& mesh, int num_handles, const ResponseBasisOptions& options)
      : size(mesh.BoundingBoxDiagonal()),
        preparation(testing::PrepareMesh(mesh, num_handles)),
        direct(*CreateGradientFieldDeformer(preparation, {})),
        basis(*CreateResponseBasis(preparation, testing::AllVertices(mesh), options)) {}

  double ErrorMm(const std::vector<HandlePose>& poses) {
    FloatPositions positions;
    basis->Evaluate(poses, &positions);
    return LargestDistance(positions, direct->Deform(poses)->positions);
  }

  double size;
  std::shared_ptr<MeshPreparation> preparation;
  std::unique_ptr<Deformer> direct;
  std::unique_ptr<VertexResponse> basis;
};

class ResponseBasisTest : public ::testing::TestWithParam<std::tuple<TetMesh (*)(), int>> {
 protected:
  TetMesh mesh_ = std::get<0>(GetParam())();
  int num_handles_ = std::get<1>(GetParam());
};

// A frame reads no more of the columns than its tolerance needs: the looser, the less.
TEST_P(ResponseBasisTest, BoundHoldsAndTheErrorFollowsTheTolerance) {
  std::vector<double> errors;
  for (const double tolerance : {1e-2, 1e-4, 1e-6}) {
    ResponseBasisOptions options;
    options.tolerance_mm = tolerance * mesh_.BoundingBoxDiagonal();
    Prepared prepared(mesh_, num_handles_, options);
    RandomNumbers random(7);
    double largest = 0;
    for (const double angle : {0.001, 0.03, 0.3}) {
      const auto poses = RandomPoses(num_handles_, angle, 0.01, prepared.size, &random);
      const double error = prepared.ErrorMm(poses);
      EXPECT_LE(error, prepared.basis->ErrorBoundMm(poses)) << tolerance << ", " << angle;
      EXPECT_LE(prepared.basis->ErrorBoundMm(poses), options.tolerance_mm);
      largest = std::max(largest, error);
    }
    errors.push_back(largest);
  }
  EXPECT_GT(errors[0], 10 * errors[1]) << "as if all were read";
  EXPECT_GT(errors[1], 10 * errors[2]);
}

// Over the prepared range, half of it and well beyond: never less than the error, and inside the
// range not a hundred times as much.
TEST_P(ResponseBasisTest, BoundHoldsAndIsNotTooWide) {
  RandomNumbers random(5);
  ResponseBasisOptions options;
  options.tolerance_mm = 1e-4 * mesh_.BoundingBoxDiagonal();
  Prepared prepared(mesh_, num_handles_, options);
  for (const double part : {0.1, 0.5, 1.0, 1.5, 3.0, 6.0}) {
    for (int sample = 0; sample < 8; ++sample) {
      auto poses = RandomPoses(num_handles_, part * options.max_rotation_rad, 0.1 * part * 0.999,
                               prepared.size, &random);
      if (sample == 0 && num_handles_ > 1) {
        poses[1].rotation_vector = -poses[0].rotation_vector;
      }
      const double error = prepared.ErrorMm(poses);
      const double bound = prepared.basis->ErrorBoundMm(poses);
      EXPECT_LE(error, bound) << part;
      if (part <= 1) {
        EXPECT_LE(bound, 100 * error) << part;
        EXPECT_LE(bound, options.tolerance_mm) << part;
        EXPECT_TRUE(prepared.basis->Covers(poses));
      } else {
        EXPECT_FALSE(prepared.basis->Covers(poses));
      }
    }
  }
}

TEST_P(ResponseBasisTest, IdentityGivesRestAndHandlesGoWhereTheirPosesSay) {
  ResponseBasisOptions options;
  options.tolerance_mm = kAllDigitsMm;
  Prepared prepared(mesh_, num_handles_, options);
  FloatPositions positions;
  prepared.basis->Evaluate(std::vector<HandlePose>(num_handles_), &positions);
  EXPECT_EQ(positions, mesh_.positions().cast<float>());

  RandomNumbers random(6);
  const auto poses = RandomPoses(num_handles_, 0.5, 0.1, prepared.size, &random);
  prepared.basis->Evaluate(poses, &positions);
  for (int h = 0; h < num_handles_; ++h) {
    for (const int32_t v : prepared.preparation->constraints().handles()[h].vertices) {
      const Eigen::Vector3d expected = ApplyPose(poses[h], mesh_.positions().row(v).transpose());
      EXPECT_LT((positions.row(v).transpose().cast<double>() - expected).norm(),
                1e-6 * prepared.size);
    }
  }
  for (const int32_t v : prepared.preparation->constraints().fixed()) {
    EXPECT_EQ(positions.row(v), mesh_.positions().row(v).cast<float>());
  }
}

TEST_P(ResponseBasisTest, MemoryIsKnownBeforeItIsBuilt) {
  const auto preparation = testing::PrepareMesh(mesh_, num_handles_);
  const std::vector<int32_t> vertices = testing::AllVertices(mesh_);
  ResponseBasisOptions options;
  options.tolerance_mm = 1e-3;
  ASSERT_OK_AND_ASSIGN(
      const ResponseBasisPlan plan,
      PlanResponseBasis(*preparation, static_cast<Eigen::Index>(vertices.size()), options));
  EXPECT_FALSE(preparation->has_laplacian());
  int64_t asked = 0;
  options.admission = [&](int64_t bytes) {
    asked = bytes;
    return absl::OkStatus();
  };
  ASSERT_OK_AND_ASSIGN(const auto basis, CreateResponseBasis(preparation, vertices, options));
  EXPECT_EQ(asked, plan.bytes);
  EXPECT_EQ(basis->num_terms_before(), plan.num_terms);
  EXPECT_LT(basis->num_terms(), plan.num_terms);
  EXPECT_LT(basis->bytes_held(), plan.bytes);
}

std::string NameOfCase(const ::testing::TestParamInfo<ResponseBasisTest::ParamType>& test) {
  const auto [mesh, num_handles] = test.param;
  return absl::StrCat(mesh == Tongue ? "Tongue" : "JitteredBar", "With", num_handles,
                      num_handles == 1 ? "Handle" : "Handles");
}

INSTANTIATE_TEST_SUITE_P(MeshesAndHandles, ResponseBasisTest,
                         ::testing::Combine(::testing::Values(JitteredBar, Tongue),
                                            ::testing::Values(1, 3)),
                         NameOfCase);

TEST(ResponseBasisPlanTest, SmallerToleranceAndWiderRangeTakeMoreTerms) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 1);
  ResponseBasisOptions options;
  ASSERT_OK_AND_ASSIGN(const auto plan, PlanResponseBasis(*preparation, 100, options));
  options.tolerance_mm /= 1000;
  ASSERT_OK_AND_ASSIGN(const auto finer, PlanResponseBasis(*preparation, 100, options));
  EXPECT_GT(finer.degree, plan.degree);
  EXPECT_GT(finer.bytes, plan.bytes);
  options.max_rotation_rad *= 4;
  ASSERT_OK_AND_ASSIGN(const auto wider, PlanResponseBasis(*preparation, 100, options));
  EXPECT_GT(wider.degree, finer.degree);
}

TEST(ResponseBasisPlanTest, TheToleranceAskedForIsKeptOverWideRanges) {
  RandomNumbers random(8);
  for (const double angle : {10.0, 90.0, 180.0}) {
    for (const double tolerance : {0.1, 0.001}) {
      ResponseBasisOptions options;
      options.max_rotation_rad = angle * kDegree;
      options.tolerance_mm = tolerance;
      Prepared prepared(JitteredBar(), 1, options);
      const auto poses = RandomPoses(1, options.max_rotation_rad, 0.1, prepared.size, &random);
      EXPECT_TRUE(prepared.basis->Covers(poses)) << angle << ", " << tolerance;
      EXPECT_LE(prepared.ErrorMm(poses), tolerance);
    }
  }
}

TEST(ResponseBasisReductionTest, HandlesAtRestAreAsGoodAsFixed) {
  const TetMesh mesh = JitteredBar();
  const auto three = testing::PrepareMesh(mesh, 3);
  std::vector<int32_t> fixed = three->constraints().fixed();
  for (const int h : {0, 2}) {
    const auto& vertices = three->constraints().handles()[h].vertices;
    fixed.insert(fixed.end(), vertices.begin(), vertices.end());
  }
  ASSERT_OK_AND_ASSIGN(const ConstraintSet constraints,
                       ConstraintSet::Create(mesh, fixed, {three->constraints().handles()[1]}));
  ASSERT_OK_AND_ASSIGN(const auto one,
                       MeshPreparation::Create(mesh, three->stiffness(), constraints, {}));
  const std::vector<int32_t> vertices = testing::AllVertices(mesh);
  ASSERT_OK_AND_ASSIGN(const auto basis_of_three, CreateResponseBasis(three, vertices, {}));
  ASSERT_OK_AND_ASSIGN(const auto basis_of_one, CreateResponseBasis(one, vertices, {}));
  RandomNumbers random(4);
  const auto poses = RandomPoses(1, 0.5, 0.1, mesh.BoundingBoxDiagonal(), &random);
  const std::vector<HandlePose> poses_of_three = {{}, poses[0], {}};
  FloatPositions a;
  FloatPositions b;
  basis_of_three->Evaluate(poses_of_three, &a);
  basis_of_one->Evaluate(poses, &b);
  EXPECT_LE(LargestDistance(a, b.cast<double>()),
            basis_of_three->ErrorBoundMm(poses_of_three) + basis_of_one->ErrorBoundMm(poses));
}

TEST(ResponseBasisCoverTest, CoversTheEdgeOfTheRangeAndNothingBeyond) {
  Prepared prepared(JitteredBar(), 1, {});
  std::vector<HandlePose> poses(1);
  poses[0].rotation_vector = {0, 0, 30 * kDegree};
  EXPECT_TRUE(prepared.basis->Covers(poses));
  poses[0].rotation_vector.z() *= 1.001;
  EXPECT_FALSE(prepared.basis->Covers(poses));
  poses[0].rotation_vector.setZero();
  poses[0].scale = 0.9;
  EXPECT_TRUE(prepared.basis->Covers(poses));
  poses[0].scale = 0.89;
  EXPECT_FALSE(prepared.basis->Covers(poses));
  // A move so far that single precision is not enough.
  poses[0] = {};
  poses[0].translation_mm.x() = 1e6;
  EXPECT_FALSE(prepared.basis->Covers(poses));
}

TEST(ResponseBasisSelectionTest, ChosenVerticesComeInTheirOrder) {
  const TetMesh mesh = JitteredBar();
  const auto preparation = testing::PrepareMesh(mesh, 1);
  const std::vector<int32_t> chosen = {100, 3, 57, 300};
  ResponseBasisOptions options;
  options.tolerance_mm = kAllDigitsMm;
  ASSERT_OK_AND_ASSIGN(const auto all,
                       CreateResponseBasis(preparation, testing::AllVertices(mesh), options));
  ASSERT_OK_AND_ASSIGN(const auto some, CreateResponseBasis(preparation, chosen, options));
  RandomNumbers random(9);
  const auto poses = RandomPoses(1, 0.4, 0, 10, &random);
  FloatPositions of_all;
  FloatPositions of_some;
  all->Evaluate(poses, &of_all);
  some->Evaluate(poses, &of_some);
  EXPECT_EQ(of_some.rows(), 4);
  EXPECT_LT(LargestDistance(of_some, of_all(chosen, Eigen::all).cast<double>()), 1e-5);
  EXPECT_LE(some->ErrorBoundMm(poses), all->ErrorBoundMm(poses));
}

TEST(ResponseBasisProgressTest, ColumnsAreCountedUpToTheLastAndTheWorkCanEndBetweenThem) {
  const TetMesh mesh = testing::Bar({3, 3, 6});
  const auto preparation = testing::PrepareMesh(mesh, 2, {});
  std::vector<int64_t> steps;
  ResponseBasisOptions options;
  options.tolerance_mm = 1e-6;  // so that there are several passes
  options.observer = [&steps](const PreparationProgress& progress) {
    EXPECT_EQ(progress.stage, PreparationStage::kAnswers);
    steps.push_back(progress.step);
    steps.push_back(progress.steps);
  };
  const std::vector<int32_t> vertices = {0, 1, 2};
  ASSERT_OK_AND_ASSIGN(const auto basis, CreateResponseBasis(preparation, vertices, options));
  const int64_t all = steps.back();
  EXPECT_GE(all, basis->num_terms_before()) << "those of the guard degree are measured, too";
  for (size_t i = 0; i < steps.size(); i += 2) {
    EXPECT_EQ(steps[i + 1], all);
    if (i > 0) {
      EXPECT_GT(steps[i], steps[i - 2]);
    }
  }
  EXPECT_EQ(steps.front(), 0);
  EXPECT_EQ(steps[steps.size() - 2], all);
  // Cancelled at a column: none comes after it.
  for (const int64_t last : {int64_t{0}, all / 2}) {
    steps.clear();
    const Cancellation cancellation(
        [&] { return !steps.empty() && steps[steps.size() - 2] >= last; });
    EXPECT_THAT(CreateResponseBasis(preparation, vertices, options, cancellation),
                StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
    EXPECT_LT(steps[steps.size() - 2], all);
  }
}

TEST(ResponseBasisErrorTest, RefusalComesBeforeAnythingIsBuilt) {
  const TetMesh mesh = JitteredBar();
  const auto preparation = testing::PrepareMesh(mesh, 1);
  ResponseBasisOptions options;
  options.admission = [](int64_t) { return absl::ResourceExhaustedError("no room"); };
  EXPECT_THAT(CreateResponseBasis(preparation, {1, 2}, options),
              StatusIs(absl::StatusCode::kResourceExhausted, "no room"));
  EXPECT_FALSE(preparation->has_laplacian());
  EXPECT_THAT(CreateLinearElasticResponse(preparation, {1, 2}, {.admission = options.admission}),
              StatusIs(absl::StatusCode::kResourceExhausted, "no room"));
  EXPECT_FALSE(preparation->has_elastic());
}

TEST(ResponseBasisErrorTest, OptionsAndVerticesAreChecked) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 3);
  EXPECT_THAT(CreateResponseBasis(preparation, {}, {}), StatusIs(kInvalid, HasSubstr("at least")));
  EXPECT_THAT(CreateResponseBasis(preparation, {-1}, {}), StatusIs(kInvalid, HasSubstr("-1")));
  EXPECT_THAT(CreateLinearElasticResponse(preparation, {99999}, {}),
              StatusIs(kInvalid, HasSubstr("99999")));
  ResponseBasisOptions options;
  options.tolerance_mm = 0;
  EXPECT_THAT(PlanResponseBasis(*preparation, 1, options),
              StatusIs(kInvalid, HasSubstr("tolerance_mm")));
  options = {};
  options.max_scale_change = 1;
  EXPECT_THAT(PlanResponseBasis(*preparation, 1, options),
              StatusIs(kInvalid, HasSubstr("max_scale_change")));
  options = {};
  options.max_rotation_rad = 20;
  EXPECT_THAT(PlanResponseBasis(*preparation, 1, options),
              StatusIs(kInvalid, HasSubstr("smaller range")));
}

TEST(LinearElasticResponseTest, EqualsTheModelWithinItsBound) {
  RandomNumbers random(2);
  for (const int num_handles : {1, 3}) {
    const TetMesh mesh = JitteredBar();
    const auto preparation = testing::PrepareMesh(mesh, num_handles);
    ASSERT_OK_AND_ASSIGN(const auto direct, CreateLinearElasticDeformer(preparation));
    ASSERT_OK_AND_ASSIGN(const auto response,
                         CreateLinearElasticResponse(preparation, testing::AllVertices(mesh), {}));
    EXPECT_EQ(response->num_terms_before(), 12 * num_handles);
    EXPECT_LE(response->num_terms(), 12 * num_handles);
    EXPECT_LT(response->bytes_held(),
              LinearElasticResponseBytes(*preparation, std::nullopt, mesh.num_vertices()));
    for (const double angle : {0.0, 0.2, 0.6, 1.0, 6.0}) {
      const auto poses = RandomPoses(num_handles, angle, 0.1, mesh.BoundingBoxDiagonal(), &random);
      FloatPositions positions;
      response->Evaluate(poses, &positions);
      ASSERT_OK_AND_ASSIGN(const Deformation expected, direct->Deform(poses));
      const double error = LargestDistance(positions, expected.positions);
      EXPECT_LE(error, response->ErrorBoundMm(poses));
      EXPECT_LE(response->ErrorBoundMm(poses), 100 * error);
      // The digits of 30 degrees are enough for some more.
      if (angle <= 0.6) {
        EXPECT_TRUE(response->Covers(poses)) << angle;
      }
    }
    FloatPositions rest;
    response->Evaluate(std::vector<HandlePose>(num_handles), &rest);
    EXPECT_EQ(rest, mesh.positions().cast<float>());
  }
}

}  // namespace
}  // namespace tissueform
