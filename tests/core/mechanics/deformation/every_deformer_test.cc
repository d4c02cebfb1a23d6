// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

// What every model promises, regardless of its mathematics.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::kInvalid;
using testing::Pose;
using testing::StatusIs;

struct Case {
  std::string name;
  DeformerOptions options;
  // Largest distance in mm from a rigid motion of everything; none: the model does not promise it.
  std::optional<double> rigid_tolerance_mm;
  // The same from an affine motion of the whole boundary.
  std::optional<double> affine_tolerance_mm;
  // Whether it comes to its answer by many, which a caller may see.
  bool iterates = false;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class EveryDeformerTest : public ::testing::TestWithParam<Case> {
 protected:
  static std::unique_ptr<Deformer> Create(const std::shared_ptr<MeshPreparation>& preparation) {
    return CreateDeformer(preparation, GetParam().options).value();
  }
};

class RigidDeformerTest : public EveryDeformerTest {};
class ElasticDeformerTest : public EveryDeformerTest {};
class IteratingDeformerTest : public EveryDeformerTest {};

// The largest distance of an answer from where `pose` puts each vertex.
double DistanceFromPose(const MeshPreparation& preparation, const HandlePose& pose,
                        const Positions& answer) {
  double largest = 0;
  for (Eigen::Index v = 0; v < answer.rows(); ++v) {
    const Eigen::Vector3d rest = preparation.mesh().positions().row(v);
    largest = std::max(largest, (answer.row(v).transpose() - ApplyPose(pose, rest)).norm());
  }
  return largest;
}

TEST_P(RigidDeformerTest, OneRigidPoseOnEverythingIsThatRigidMotion) {
  // Without a fixed region: two handles carry all constraints.
  const TetMesh bar = testing::Bar({3, 3, 6}, 2.0, 0.2);
  const double top = bar.positions().col(2).maxCoeff() - 1.0;
  ASSERT_OK_AND_ASSIGN(
      const ConstraintSet ends,
      ConstraintSet::Create(
          bar, {},
          {{"low", testing::SelectVertices(bar, [](const auto& v) { return v.z() < 1.0; })},
           {"high", testing::SelectVertices(bar, [=](const auto& v) { return v.z() > top; })}}));
  ASSERT_OK_AND_ASSIGN(
      const auto preparation,
      MeshPreparation::Create(bar, testing::MixedStiffness(bar.num_tets()), ends, {}));
  const HandlePose pose = Pose({0.4, -2.3, 0.9}, {5, -7, 2});
  ASSERT_OK_AND_ASSIGN(const Deformation answer, Create(preparation)->Deform({pose, pose}));
  EXPECT_LT(DistanceFromPose(*preparation, pose, answer.positions), *GetParam().rigid_tolerance_mm);
}

TEST_P(ElasticDeformerTest, PatchOfConstantStrainIsReproduced) {
  const auto preparation = testing::PrepareWrappedBlock().value();
  for (const HandlePose& pose :
       {Pose({0.2, 0.1, -0.3}, {1, 2, 3}, 1.1), Pose({0.7, 0.9, -1.3}, {1, 2, 3}, 1.4)}) {
    ASSERT_OK_AND_ASSIGN(const Deformation answer, Create(preparation)->Deform({pose}));
    EXPECT_TRUE(answer.summary.converged);
    EXPECT_LT(DistanceFromPose(*preparation, pose, answer.positions),
              *GetParam().affine_tolerance_mm);
  }
}

// To the bit. The mesh has more tets and vertices than a thread takes at once.
TEST_P(EveryDeformerTest, DoesNotDependOnThreads) {
  const TetMesh bar = testing::Bar({10, 10, 14}, 1.0, 0.15);
  std::vector<Positions> answers;
  for (const int threads : {1, 3}) {
    PreparationOptions options;
    options.threads = threads;
    const auto preparation = testing::PrepareMesh(bar, 2, options);
    ASSERT_OK_AND_ASSIGN(
        Deformation answer,
        Create(preparation)->Deform({Pose({0, 0, 0.2}, {0, 1, 2}), Pose({0.1, 0, 0}, {0, 1, 1})}));
    answers.push_back(std::move(answer.positions));
  }
  EXPECT_EQ(answers[0], answers[1]);
}

TEST_P(EveryDeformerTest, PosesMustFitTheHandlesAndBeFinite) {
  const auto deformer = Create(testing::PrepareBar({}, 2).value());
  std::vector<HandlePose> poses(1);
  EXPECT_THAT(deformer->Deform(poses), StatusIs(kInvalid, HasSubstr("got 1 poses for 2 handles")));
  poses.resize(2);
  poses[1].translation_mm.x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(deformer->Deform(poses),
              StatusIs(kInvalid, AllOf(HasSubstr("\"right\""), HasSubstr("translation"))));
}

TEST_P(IteratingDeformerTest, WarmStartIsFasterAndEndsInTheSamePlace) {
  const auto preparation = testing::PrepareBar().value();
  const auto warm = Create(preparation);
  DeformControl control;
  control.warm_start = true;
  const HandlePose pose = Pose({0, 0.02, 0.32}, {1.02, 0, 1});
  ASSERT_THAT(warm->Deform({Pose({0, 0, 0.3}, {1, 0, 1})}), IsOk());
  ASSERT_OK_AND_ASSIGN(const Deformation started, warm->Deform({pose}, control));
  ASSERT_OK_AND_ASSIGN(const Deformation cold, Create(preparation)->Deform({pose}));
  EXPECT_TRUE(started.summary.converged);
  EXPECT_LT(started.summary.iterations, cold.summary.iterations);
  EXPECT_LT(testing::LargestDistance(started.positions, cold.positions), 1e-4);
  // Back at rest in one jump: the last answer does not trap it.
  ASSERT_OK_AND_ASSIGN(const Deformation rest, warm->Deform({HandlePose{}}, control));
  EXPECT_LT(testing::LargestDistance(rest.positions, preparation->mesh().positions()), 1e-9);
}

TEST_P(IteratingDeformerTest, CallerSeesEveryAnswerAndMayStop) {
  const auto preparation = testing::PrepareBar().value();
  std::vector<int> seen;
  DeformControl control;
  control.on_progress = [&](const Deformation& so_far) {
    EXPECT_EQ(so_far.positions.rows(), preparation->mesh().num_vertices());
    seen.push_back(so_far.summary.iterations);
    return seen.size() < 3;
  };
  ASSERT_OK_AND_ASSIGN(const Deformation answer,
                       Create(preparation)->Deform({Pose({0, 0, 0.3}, {1, 0, 2})}, control));
  EXPECT_EQ(seen, (std::vector<int>{seen[0], seen[0] + 1, seen[0] + 2}));
  EXPECT_TRUE(answer.summary.cancelled);
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_EQ(answer.summary.iterations, seen.back());
}

TEST_P(IteratingDeformerTest, RunningOutOfIterationsIsAResult) {
  DeformerOptions options = GetParam().options;
  options.gradient_field.max_iterations = 2;
  options.arap.max_iterations = 2;
  options.neo_hookean.max_iterations = 2;
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateDeformer(testing::PrepareBar().value(), options));
  ASSERT_OK_AND_ASSIGN(const Deformation answer, deformer->Deform({Pose({0, 0, 0.3}, {1, 0, 2})}));
  EXPECT_FALSE(answer.summary.converged);
  EXPECT_FALSE(answer.summary.cancelled);
  EXPECT_EQ(answer.summary.iterations, 2);
}

DeformerOptions Options(DeformationModel model) {
  DeformerOptions options;
  options.model = model;
  // Tighter than the defaults: the equilibrium itself is compared.
  options.gradient_field.tolerance_mm = 1e-10;
  options.gradient_field.max_iterations = 200;
  options.arap.tolerance_mm = 1e-6;
  options.arap.max_iterations = 300;
  options.neo_hookean.tolerance = 1e-6;
  return options;
}

std::vector<Case> AllCases() {
  DeformerOptions estimated = Options(DeformationModel::kGradientField);
  estimated.gradient_field.rotation = RotationMode::kEstimated;
  DeformerOptions newton = Options(DeformationModel::kNeoHookean);
  newton.neo_hookean.newton_after = 0;
  return {
      {"GradientField", Options(DeformationModel::kGradientField), 1e-10, std::nullopt},
      {"EstimatedRotations", estimated, std::nullopt, std::nullopt, true},
      {"Arap", Options(DeformationModel::kArap), 1e-10, std::nullopt, true},
      {"LinearElastic", Options(DeformationModel::kLinearElastic), std::nullopt, 1e-12},
      {"NeoHookean", Options(DeformationModel::kNeoHookean), 1e-4, 1e-5, true},
      {"NeoHookeanByNewton", newton, 1e-4, 1e-5, true},
  };
}

// Those that promise it (have a tolerance for it).
template <typename Promise>
std::vector<Case> CasesWith(Promise Case::*promise) {
  std::vector<Case> cases = AllCases();
  std::erase_if(cases, [promise](const Case& c) { return !static_cast<bool>(c.*promise); });
  return cases;
}

std::string NameOf(const ::testing::TestParamInfo<Case>& test) { return test.param.name; }

INSTANTIATE_TEST_SUITE_P(Models, EveryDeformerTest, ::testing::ValuesIn(AllCases()), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, RigidDeformerTest,
                         ::testing::ValuesIn(CasesWith(&Case::rigid_tolerance_mm)), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, ElasticDeformerTest,
                         ::testing::ValuesIn(CasesWith(&Case::affine_tolerance_mm)), NameOf);

INSTANTIATE_TEST_SUITE_P(Models, IteratingDeformerTest,
                         ::testing::ValuesIn(CasesWith(&Case::iterates)), NameOf);

}  // namespace
}  // namespace tissueform
