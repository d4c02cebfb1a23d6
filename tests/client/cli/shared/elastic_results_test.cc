// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/elastic_results.h"

#include "gtest/gtest.h"

#include "core/planning/plan_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

PlanProblem BarProblem(DeformationModel model) {
  PlanProblem problem =
      ResolvePlan(ReadPlan(testing::TestDataPath("plans/bar/plan.json")).value()).value();
  problem.deformer.model = model;
  return problem;
}

TEST(ElasticResultsTest, NonElasticModelsHaveNoElasticResults) {
  for (const auto model : {DeformationModel::kGradientField, DeformationModel::kArap}) {
    const PlanProblem problem = BarProblem(model);
    EXPECT_FALSE(SummarizeElastic(problem, problem.mesh->positions()).has_value());
    TetMeshFile file{.mesh = *problem.mesh, .point_data = {}, .cell_data = {}};
    AddElasticArrays(problem, problem.mesh->positions(), &file);
    EXPECT_TRUE(file.point_data.empty() && file.cell_data.empty());
  }
}

TEST(ElasticResultsTest, HasNoForcesOrStressesAtRest) {
  for (const auto model : {DeformationModel::kLinearElastic, DeformationModel::kNeoHookean}) {
    const PlanProblem problem = BarProblem(model);
    const auto summary = SummarizeElastic(problem, problem.mesh->positions());
    ASSERT_TRUE(summary.has_value());
    EXPECT_EQ(summary->strain_energy_mj, 0);
    EXPECT_EQ(summary->von_mises_max_pa.value, 0);
    EXPECT_EQ(summary->principal_strain_max.value, 0);
    EXPECT_TRUE(summary->handles[0].reaction.force_n.isZero(0));
  }
}

// A file of statistics stays a file of JSON.
TEST(ElasticResultsTest, ResultsUndefinedDueToAnInvertedTetAreNull) {
  const PlanProblem problem = BarProblem(DeformationModel::kNeoHookean);
  Positions folded = problem.mesh->positions();
  folded.row(160) += Eigen::RowVector3d(0, 0, 30);  // far beyond its neighbours
  const auto summary = SummarizeElastic(problem, folded);
  ASSERT_TRUE(summary.has_value());
  const auto json = nlohmann::json::parse(ElasticToJson(*summary).dump());
  EXPECT_TRUE(json["strain_energy_mj"].is_null());
  EXPECT_TRUE(json["von_mises_stress_pa"]["max"].is_null());
  EXPECT_TRUE(json["von_mises_stress_pa"]["p95"].is_null());
  EXPECT_TRUE(json["principal_strain"]["max"].is_number());
  // No tet at either end is touched.
  EXPECT_EQ(json["unbalanced_force_n"], 0);
}

}  // namespace
}  // namespace tissueform
