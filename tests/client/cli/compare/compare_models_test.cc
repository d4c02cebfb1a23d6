// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <fstream>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class CompareModelsTest : public CliTest {
 protected:
  static std::string BarPlan() { return TestDataPath("plans/bar/plan.json"); }
};

TEST_F(CompareModelsTest, ComparesAllModelsWithNeoHookeanByDefault) {
  const ProcessResult result = Run({"compare", BarPlan(), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["reference"], "neo_hookean");
  EXPECT_EQ(json["models"].size(), 4U);
  EXPECT_EQ(json["models"]["neo_hookean"]["overall"]["max_mm"], 0);
  for (const char* model : {"gradient_field", "arap", "linear_elastic"}) {
    EXPECT_GT(json["models"][model]["overall"]["mean_mm"], 0) << model;
    EXPECT_LT(json["models"][model]["overall"]["mean_mm"], 5) << model;
  }
}

TEST_F(CompareModelsTest, RegionsAreFixedEveryHandleAndFreeVertices) {
  const ProcessResult result =
      Run({"compare", BarPlan(), "--models", "gradient_field,linear_elastic", "--reference",
           "linear_elastic", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["models"].size(), 2U);
  const nlohmann::json& regions = json["models"]["gradient_field"]["regions"];
  EXPECT_EQ(regions["fixed"]["vertices"], 25);
  EXPECT_EQ(regions["handle top"]["vertices"], 25);
  EXPECT_EQ(regions["free"]["vertices"], 325 - 50);
  // Constrained vertices are where the poses put them, for every model.
  EXPECT_EQ(regions["fixed"]["max_mm"], 0);
  EXPECT_LT(regions["handle top"]["max_mm"], 1e-9);
  EXPECT_GT(regions["free"]["max_mm"], 0.1);
}

TEST_F(CompareModelsTest, FolderGetsAResultWithDifferencesOfEachModel) {
  const ProcessResult result =
      Run({"compare", BarPlan(), "--models", "arap", "--out", "compared", "--csv", "models.csv"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(Files(), ElementsAre("compared", "models.csv"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile arap, ReadTetMesh(Path("compared/arap.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile reference, ReadTetMesh(Path("compared/neo_hookean.vtu")));
  const Attribute* difference = FindAttribute(arap.point_data, "difference_mm");
  ASSERT_NE(difference, nullptr);
  const std::vector<double> values = ToDoubles(*difference);
  const Eigen::Map<const Positions> rows(values.data(), arap.mesh.num_vertices(), 3);
  EXPECT_LT((reference.mesh.positions() + rows - arap.mesh.positions()).cwiseAbs().maxCoeff(),
            1e-9);
  EXPECT_NE(FindAttribute(arap.point_data, "displacement_mm"), nullptr);
  EXPECT_THAT(Read("models.csv"), AllOf(StartsWith("model,reference,region,vertices,mean_mm"),
                                        HasSubstr("\narap,neo_hookean,handle top,25,")));
}

TEST_F(CompareModelsTest, RangesOfThePlanGiveEveryElasticModelTheBandThatDeformGivesIt) {
  nlohmann::json plan = nlohmann::json::parse(std::ifstream(BarPlan()));
  plan["version"] = 2;
  plan["mesh"] = TestDataPath("plans/bar/bar.vtu");
  plan["uncertainty"] = {{"youngs_modulus_factor_95", 2}};
  Write("plan.json", plan.dump());
  const ProcessResult result =
      Run({"compare", "plan.json", "--allow-outside", "--out", "compared", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json models = nlohmann::json::parse(result.out)["models"];
  for (const std::string model : {"gradient_field", "arap", "linear_elastic", "neo_hookean"}) {
    const bool is_elastic = model == "linear_elastic" || model == "neo_hookean";
    EXPECT_EQ(models[model].contains("material_uncertainty"), is_elastic) << model;
    ASSERT_OK_AND_ASSIGN(const TetMeshFile compared,
                         ReadTetMesh(Path("compared/" + model + ".vtu")));
    const Attribute* band = FindAttribute(compared.point_data, "material_uncertainty_p95_mm");
    ASSERT_EQ(band != nullptr, is_elastic) << model;
    if (!is_elastic) continue;
    ASSERT_EQ(
        Run({"deform", "plan.json", "--allow-outside", "--out", "alone.vtu", "--model", model})
            .exit_code,
        0);
    ASSERT_OK_AND_ASSIGN(const TetMeshFile alone, ReadTetMesh(Path("alone.vtu")));
    EXPECT_EQ(ToDoubles(*band),
              ToDoubles(*FindAttribute(alone.point_data, "material_uncertainty_p95_mm")));
  }
}

TEST_F(CompareModelsTest, TableHasABlockForEachModelButTheReference) {
  const ProcessResult result =
      Run({"compare", BarPlan(), "--models", "gradient_field,arap", "--reference", "arap"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("of arap"), HasSubstr("gradient_field: "),
                                HasSubstr("\nhandle top "), Not(HasSubstr("linear_elastic"))));
}

TEST_F(CompareModelsTest, OptionsOfTheOtherModeAreAUsageError) {
  EXPECT_THAT(Run({"compare", BarPlan(), "b.vtu"}), FailsWith(2, HasSubstr("B")));
  EXPECT_THAT(Run({"compare", BarPlan(), "--by", "anatomy"}), FailsWith(2, HasSubstr("--by")));
  EXPECT_THAT(Run({"compare", BarPlan(), "--out", "difference.vtu"}),
              FailsWith(2, HasSubstr("folder")));
  EXPECT_THAT(Run({"compare", "a.vtu", "b.vtu", "--models", "arap"}),
              FailsWith(2, HasSubstr("--models")));
  EXPECT_THAT(Run({"compare", "a.vtu"}), FailsWith(2, HasSubstr("two results, or one plan")));
  EXPECT_THAT(Run({"compare", "a.vtu", "b.vtu", "--out", "difference.csv"}),
              FailsWith(2, HasSubstr(".vtu")));
  EXPECT_THAT(Run({"compare", BarPlan(), "--models", "rubber"}), FailsWith(2, HasSubstr("rubber")));
}

TEST_F(CompareModelsTest, ReportsAnUnusableFolderBeforeStarting) {
  Write("taken", "");
  EXPECT_THAT(Run({"compare", BarPlan(), "--out", "taken"}), FailsWith(1, HasSubstr("taken")));
}

}  // namespace
}  // namespace tissueform::testing
