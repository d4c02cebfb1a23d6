// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/model_settings.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/plan_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

PlanProblem Bundled(const std::string& plan) {
  return *ResolvePlan(*ReadPlan(testing::TestDataPath("plans/" + plan + "/plan.json")));
}

class ModelSettingsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    SetBlasThreads(1);
    lips = new PlanProblem(Bundled("head_lips"));
  }
  static void TearDownTestSuite() {
    delete lips;
    lips = nullptr;
  }

  static PlanProblem* lips;
};

PlanProblem* ModelSettingsTest::lips = nullptr;

TEST_F(ModelSettingsTest, ThePlansOwnComeFirstAndAllDiffer) {
  for (const std::string plan : {"head_lips", "three_segments"}) {
    const std::vector<ModelSettings> settings = SettingsToTry(Bundled(plan));
    EXPECT_EQ(settings.front(), ModelSettings());
    for (size_t s = 1; s < settings.size(); ++s) {
      EXPECT_EQ(std::ranges::count(settings, settings[s]), 1);
    }
    const bool varies = std::ranges::any_of(
        settings, [](const ModelSettings& s) { return s.vestibule_mm.has_value(); });
    EXPECT_EQ(varies, plan == "head_lips");
  }
}

TEST_F(ModelSettingsTest, OneStiffnessHasNothingToVary) {
  PlanProblem uniform = Bundled("three_segments");
  uniform.stiffness.setConstant(1e4);
  EXPECT_EQ(SettingsToTry(uniform), std::vector<ModelSettings>{ModelSettings()});
}

// Why a factor on all stiffness is not among the settings.
TEST_F(ModelSettingsTest, AFactorOnAllStiffnessMovesNothing) {
  SettingsDeformer deformer(*lips, 1);
  ASSERT_OK_AND_ASSIGN(const Deformation before, deformer.Deform({}, lips->poses));
  PlanProblem stiffer = *lips;
  stiffer.stiffness *= 3.7;
  SettingsDeformer other(stiffer, 1);
  ASSERT_OK_AND_ASSIGN(const Deformation after, other.Deform({}, lips->poses));
  EXPECT_LT((after.positions - before.positions).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_GT((before.positions - lips->mesh->positions()).rowwise().norm().maxCoeff(), 5);
}

TEST_F(ModelSettingsTest, ContrastScalesRatiosAndKeepsTheGeometricMean) {
  Eigen::VectorXd stiffness(4);
  stiffness << 16e3, 27e3, 54e3, 16e3;
  EXPECT_EQ(WithContrast(stiffness, 1), stiffness);
  const Eigen::VectorXd twice = WithContrast(stiffness, 2);
  EXPECT_NEAR(twice[2] / twice[1], 4, 1e-12);
  EXPECT_NEAR(twice.array().log().mean(), stiffness.array().log().mean(), 1e-12);
  const Eigen::VectorXd none = WithContrast(stiffness, 0);
  EXPECT_NEAR(none.maxCoeff() / none.minCoeff(), 1, 1e-12);
}

// Which freed vertices are within reach of the seam, searched without the function's help.
std::set<int32_t> Within(const PlanProblem& problem, double reach_mm) {
  std::set<int32_t> seam;
  for (const ContactRow& row : problem.constraints.contact()) {
    if (row.other != ContactRow::kBone) seam.insert({row.vertex, row.other});
  }
  std::set<int32_t> within;
  for (const FreedVertex& freed : problem.freed) {
    for (const int32_t vertex : seam) {
      const double distance =
          (problem.mesh->positions().row(freed.vertex) - problem.mesh->positions().row(vertex))
              .norm();
      if (distance <= reach_mm) within.insert(freed.vertex);
    }
  }
  return within;
}

TEST_F(ModelSettingsTest, TissueBeyondTheVestibuleSticks) {
  for (const double reach_mm : {0.0, 4.0, 7.0}) {
    const ConstraintSet constraints = WithVestibule(*lips, reach_mm);
    const std::set<int32_t> near = Within(*lips, reach_mm);
    const std::set<int32_t> stuck(constraints.constrained().begin(),
                                  constraints.constrained().end());
    for (const FreedVertex& freed : lips->freed) {
      EXPECT_EQ(stuck.contains(freed.vertex), !near.contains(freed.vertex)) << freed.vertex;
    }
    for (const ContactRow& row : constraints.contact()) EXPECT_FALSE(stuck.contains(row.vertex));
  }
  EXPECT_GT(Within(*lips, 7).size(), Within(*lips, 4).size());
}

TEST_F(ModelSettingsTest, AWideVestibuleIsThePlans) {
  const ConstraintSet constraints = WithVestibule(*lips, 1e3);
  EXPECT_EQ(constraints.constrained(), lips->constraints.constrained());
  EXPECT_EQ(constraints.contact(), lips->constraints.contact());
}

// At 0 every freed vertex moves as the bone that it sticks to.
TEST_F(ModelSettingsTest, StuckTissueMovesAsItsBone) {
  SettingsDeformer deformer(*lips, 1);
  ASSERT_OK_AND_ASSIGN(const Deformation answer,
                       deformer.Deform({.vestibule_mm = 0.0}, lips->poses));
  ASSERT_EQ(lips->poses.size(), 1U);
  const std::set<int32_t> seam = Within(*lips, 0);
  for (const FreedVertex& freed : lips->freed) {
    if (seam.contains(freed.vertex)) continue;
    const Eigen::Vector3d moved =
        answer.positions.row(freed.vertex) - lips->mesh->positions().row(freed.vertex);
    const Eigen::Vector3d bone = freed.region == ConstraintSet::kFixed
                                     ? Eigen::Vector3d::Zero().eval()
                                     : lips->poses[0].translation_mm;
    EXPECT_LT((moved - bone).norm(), 1e-9) << freed.vertex;
  }
}

// In any order of settings the answer is the same.
TEST_F(ModelSettingsTest, TheLastPreparationIsNotMistakenForAnother) {
  SettingsDeformer deformer(*lips, 1);
  ASSERT_OK_AND_ASSIGN(const Deformation first, deformer.Deform({}, lips->poses));
  const ModelSettings stiff = {.stiffness_contrast = 2, .vestibule_mm = 4.0};
  ASSERT_OK_AND_ASSIGN(const Deformation other, deformer.Deform(stiff, lips->poses));
  ASSERT_OK_AND_ASSIGN(const Deformation again, deformer.Deform({}, lips->poses));
  EXPECT_EQ(first.positions, again.positions);
  EXPECT_GT((first.positions - other.positions).cwiseAbs().maxCoeff(), 0.01);
}

}  // namespace
}  // namespace tissueform
