// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

// What every model promises, whatever its mathematics.
namespace tissueform {
namespace {

using testing::Pose;

struct Case {
  std::string name;
  DeformerOptions options;
  // Largest distance in mm from a rigid motion of everything; none: the model does not promise it.
  std::optional<double> rigid_tolerance_mm;
  // The same from an affine motion of the whole boundary.
  std::optional<double> affine_tolerance_mm;
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

DeformerOptions Options(DeformationModel model) {
  DeformerOptions options;
  options.model = model;
  // Tighter than the default: the equilibrium itself is compared.
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
      {"EstimatedRotations", estimated, std::nullopt, std::nullopt},
      {"Arap", Options(DeformationModel::kArap), 1e-10, std::nullopt},
      {"LinearElastic", Options(DeformationModel::kLinearElastic), std::nullopt, 1e-12},
      {"NeoHookean", Options(DeformationModel::kNeoHookean), 1e-4, 1e-5},
      {"NeoHookeanByNewton", newton, 1e-4, 1e-5},
  };
}

std::vector<Case> CasesWith(std::optional<double> Case::*tolerance) {
  std::vector<Case> cases = AllCases();
  std::erase_if(cases, [tolerance](const Case& c) { return !(c.*tolerance).has_value(); });
  return cases;
}

std::string NameOf(const ::testing::TestParamInfo<Case>& test) { return test.param.name; }

INSTANTIATE_TEST_SUITE_P(Models, EveryDeformerTest, ::testing::ValuesIn(AllCases()), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, RigidDeformerTest,
                         ::testing::ValuesIn(CasesWith(&Case::rigid_tolerance_mm)), NameOf);
INSTANTIATE_TEST_SUITE_P(Models, ElasticDeformerTest,
                         ::testing::ValuesIn(CasesWith(&Case::affine_tolerance_mm)), NameOf);

}  // namespace
}  // namespace tissueform
