// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <memory>

#include "client/accuracy/accuracy_case.h"
#include "client/accuracy/calculix.h"
#include "core/deformation/create_deformer.h"
#include "core/deformation/mesh_preparation.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// The elastic models against an independent program. Without ccx these tests fail: it is one of
// deploy/packages.txt.
class CalculixOracleTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = ::testing::TempDir() + "/calculix_oracle_test." + info->name();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Largest distance of a vertex between the model and CalculiX, mm.
  absl::StatusOr<double> Distance(const AccuracyCase& problem, DeformationModel model,
                                  double poisson_ratio) const {
    const CalculixLaw law =
        model == DeformationModel::kLinearElastic ? CalculixLaw::kLinear : CalculixLaw::kNeoHookean;
    const auto reference = RunCalculix(
        {problem.mesh, problem.stiffness, poisson_ratio, problem.constraints,
         ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses), law},
        folder_);
    if (!reference.ok()) return reference.status();
    const auto answer = Answer(problem, model, poisson_ratio);
    if (!answer.ok()) return answer.status();
    return (*answer - reference->deformed).rowwise().norm().maxCoeff();
  }

 private:
  static absl::StatusOr<Positions> Answer(const AccuracyCase& problem, DeformationModel model,
                                          double poisson_ratio) {
    PreparationOptions options;
    options.poisson_ratio = poisson_ratio;
    const auto preparation = MeshPreparation::Create(problem.mesh, problem.stiffness,
                                                     problem.constraints, std::move(options));
    if (!preparation.ok()) return preparation.status();
    DeformerOptions deformer_options;
    deformer_options.model = model;
    const auto deformer = CreateDeformer(*preparation, deformer_options);
    if (!deformer.ok()) return deformer.status();
    auto deformation = (*deformer)->Deform(problem.poses);
    if (!deformation.ok()) return deformation.status();
    if (!deformation->summary.converged) return absl::InternalError("not converged");
    return deformation->positions;
  }

  std::string folder_;
};

// Coarse enough for sanitizers.
constexpr std::array<int, 3> kBlockCells = {12, 9, 8};
constexpr int kBarCells = 4;

absl::StatusOr<AccuracyCase> Tongue() {
  return CaseOfPlan("tongue", "", testing::TestDataPath("plans/tongue/plan.json"));
}

double LargestMove(const AccuracyCase& problem) {
  return ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses)
      .rowwise()
      .norm()
      .maxCoeff();
}

// The coarser of the bundled heads: three stiffnesses by tissue.
absl::StatusOr<AccuracyCase> HeadChin() {
  return CaseOfPlan("head_chin", "", testing::TestDataPath("plans/head_chin/plan.json"));
}

// CalculiX prints seven digits: up to 5e-7 mm for each coordinate of a move of some millimetres.
TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnTheLayeredBlock) {
  for (const double poisson_ratio : {0.0, 0.3, 0.45}) {
    for (const auto& problem : {BlockAlongCase(kBlockCells), BlockUpCase(kBlockCells)}) {
      ASSERT_OK_AND_ASSIGN(
          const double distance,
          Distance(problem.value(), DeformationModel::kLinearElastic, poisson_ratio));
      EXPECT_LT(distance, 1e-6) << problem->name << ", nu = " << poisson_ratio;
    }
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnABarWhoseEndTurns) {
  for (const double poisson_ratio : {0.3, 0.45, 0.49}) {
    ASSERT_OK_AND_ASSIGN(
        const double distance,
        Distance(BendCase(kBarCells).value(), DeformationModel::kLinearElastic, poisson_ratio));
    // Twice: the end goes aside by 8 mm.
    EXPECT_LT(distance, 2e-6) << "nu = " << poisson_ratio;
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnTheTongue) {
  for (const double poisson_ratio : {0.3, 0.45}) {
    ASSERT_OK_AND_ASSIGN(
        const double distance,
        Distance(Tongue().value(), DeformationModel::kLinearElastic, poisson_ratio));
    EXPECT_LT(distance, 1e-6) << "nu = " << poisson_ratio;
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnARealHead) {
  ASSERT_OK_AND_ASSIGN(const double distance,
                       Distance(HeadChin().value(), DeformationModel::kLinearElastic, 0.45));
  EXPECT_LT(distance, 1e-6);
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnTheLayeredBlock) {
  for (const auto& problem : {BlockAlongCase(kBlockCells), BlockUpCase(kBlockCells)}) {
    ASSERT_OK_AND_ASSIGN(const double distance,
                         Distance(problem.value(), DeformationModel::kNeoHookean, 0.45));
    EXPECT_LT(distance, 1e-3 * LargestMove(*problem)) << problem->name;
  }
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnABarBentAndTwisted) {
  for (const auto& problem : {BendCase(kBarCells), TwistAndStretchCase(kBarCells)}) {
    ASSERT_OK_AND_ASSIGN(const double distance,
                         Distance(problem.value(), DeformationModel::kNeoHookean, 0.45));
    EXPECT_LT(distance, 1e-3 * LargestMove(*problem)) << problem->name;
  }
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnTheTongue) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase tongue, Tongue());
  ASSERT_OK_AND_ASSIGN(const double distance,
                       Distance(tongue, DeformationModel::kNeoHookean, 0.45));
  EXPECT_LT(distance, 1e-3 * LargestMove(tongue));
}

}  // namespace
}  // namespace tissueform
