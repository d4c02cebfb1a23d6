// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <fstream>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/tet_quality.h"
#include "core/planning/planned_contact.h"
#include "tests/testing/bar_mesh.h"
#include "tests/testing/meshes.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class DeformTest : public CliTest {
 protected:
  // The bundled plan of the bar, to be changed.
  static nlohmann::json BarPlan() {
    std::ifstream stream(TestDataPath("plans/bar/plan.json"));
    return nlohmann::json::parse(stream);
  }

  static Eigen::Vector3d VectorOf(const nlohmann::json& json) {
    return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
  }

  Positions Displacements(const TetMeshFile& file) const { return Rows(file, "displacement_mm"); }

  Positions Rows(const TetMeshFile& file, const std::string& name) const {
    const Attribute* array = FindAttribute(file.point_data, name);
    if (array == nullptr) return {};
    EXPECT_EQ(array->components, 3);
    EXPECT_TRUE(std::holds_alternative<std::vector<double>>(array->values));
    const std::vector<double> values = ToDoubles(*array);
    return Eigen::Map<const Positions>(values.data(), static_cast<Eigen::Index>(values.size() / 3),
                                       3);
  }
};

TEST_F(DeformTest, BarMeshOfThePlanMatchesItsGenerator) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TestDataPath("plans/bar/bar.vtu")));
  const TetMeshFile made = BarMeshOfPlan();
  EXPECT_EQ(file.mesh.positions(), made.mesh.positions());
  EXPECT_EQ(file.mesh.tets(), made.mesh.tets());
  EXPECT_TRUE(file.point_data.at(0).values == made.point_data.at(0).values);
  EXPECT_TRUE(file.cell_data.at(0).values == made.cell_data.at(0).values);
  EXPECT_TRUE(file.cell_data.at(1).values == made.cell_data.at(1).values);
}

TEST_F(DeformTest, BlockMeshOfThePlanMatchesItsGenerator) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(TestDataPath("plans/block/block.vtu")));
  const TetMeshFile made = BlockMeshOfPlan();
  EXPECT_EQ(file.mesh.positions(), made.mesh.positions());
  EXPECT_EQ(file.mesh.tets(), made.mesh.tets());
  EXPECT_TRUE(file.point_data.at(0).values == made.point_data.at(0).values);
  EXPECT_TRUE(file.cell_data.at(0).values == made.cell_data.at(0).values);
}

TEST_F(DeformTest, EveryModelWritesStrainsAndKeepsTheHandleWhereItIsPut) {
  std::vector<Positions> results;
  for (const std::string model : {"gradient_field", "arap", "linear_elastic", "neo_hookean"}) {
    ASSERT_THAT(Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", model + ".vtu",
                     "--model", model, "--stats", model + ".json"}),
                Succeeds());
    ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path(model + ".vtu")));
    const Attribute* strain = FindAttribute(result.cell_data, "principal_strain");
    ASSERT_NE(strain, nullptr);
    EXPECT_EQ(strain->components, 3);
    const bool is_elastic = model == "linear_elastic" || model == "neo_hookean";
    for (const char* array : {"von_mises_stress_pa", "strain_energy_density_pa"}) {
      EXPECT_EQ(FindAttribute(result.cell_data, array) != nullptr, is_elastic) << array;
    }
    EXPECT_EQ(FindAttribute(result.point_data, "reaction_force_n") != nullptr, is_elastic);
    const auto stats = nlohmann::json::parse(Read(model + ".json"));
    EXPECT_EQ(stats.contains("elastic"), is_elastic);
    EXPECT_EQ(stats["model"], model);
    EXPECT_EQ(stats["converged"], true);
    EXPECT_EQ(stats["load"], 1);
    EXPECT_EQ(stats["poisson_ratio"], 0.45);
    results.push_back(result.mesh.positions());
  }
  for (size_t i = 1; i < results.size(); ++i) {
    EXPECT_TRUE(results[i].bottomRows(25) == results[0].bottomRows(25)) << "the handle";
    EXPECT_GT((results[i] - results[0]).rowwise().norm().maxCoeff(), 0.1) << "another model";
  }
}

TEST_F(DeformTest, RangesOfThePlanGiveElasticResultsABand) {
  nlohmann::json plan = BarPlan();
  plan["version"] = 2;
  plan["mesh"] = TestDataPath("plans/bar/bar.vtu");
  plan["uncertainty"] = {{"youngs_modulus_factor_95", 2}, {"poisson_ratio_95", {0.4, 0.49}}};
  Write("plan.json", plan.dump());
  for (const std::string model : {"linear_elastic", "neo_hookean", "gradient_field"}) {
    const ProcessResult run = Run({"deform", "plan.json", "--allow-outside", "--out",
                                   model + ".vtu", "--model", model, "--stats", "stats.json"});
    ASSERT_EQ(run.exit_code, 0);
    const auto stats = nlohmann::json::parse(Read("stats.json"));
    ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path(model + ".vtu")));
    const bool is_elastic = model != "gradient_field";
    EXPECT_EQ(stats.contains("material_uncertainty"), is_elastic);
    const Attribute* band = FindAttribute(result.point_data, "material_uncertainty_p95_mm");
    const Attribute* along = FindAttribute(result.point_data, "material_uncertainty_normal_p95_mm");
    ASSERT_EQ(band != nullptr && along != nullptr, is_elastic);
    if (!is_elastic) {
      EXPECT_THAT(run.out, HasSubstr("only for linear_elastic and neo_hookean"));
      EXPECT_THAT(run.err, IsEmpty());
      continue;
    }
    constexpr const char* kNotice = "stiffness only; excludes model and surgical error";
    EXPECT_THAT(run.out, HasSubstr(kNotice));
    EXPECT_EQ(stats["material_uncertainty"]["notice"], kNotice);
    const std::vector<double> sizes = ToDoubles(*band);
    const auto& place = stats["material_uncertainty"]["places"][0];
    EXPECT_EQ(place["name"], "surface");
    EXPECT_LE(place["max_mm"].get<double>(), *std::max_element(sizes.begin(), sizes.end()));
    EXPECT_GT(place["max_mm"].get<double>(), 0.01);
    EXPECT_EQ(*std::max_element(sizes.begin(), sizes.begin() + 25), 0) << "fixed";
    EXPECT_EQ(stats["material_uncertainty"]["causes"].back()["name"], "Poisson's ratio");
  }
}

TEST_F(DeformTest, CompareCountsVerticesWithinTheBand) {
  nlohmann::json plan = BarPlan();
  plan["version"] = 2;
  plan["mesh"] = TestDataPath("plans/bar/bar.vtu");
  plan["model"] = "linear_elastic";
  plan["uncertainty"] = {{"youngs_modulus_factor_95", 2}};
  Write("plan.json", plan.dump());
  ASSERT_THAT(Run({"deform", "plan.json", "--allow-outside", "--out", "a.vtu"}), Succeeds());
  ASSERT_OK_AND_ASSIGN(TetMeshFile b, ReadTetMesh(Path("a.vtu")));
  const std::vector<double> band =
      ToDoubles(*FindAttribute(b.point_data, "material_uncertainty_p95_mm"));
  // Every second free vertex just beyond its band, the others just within.
  Positions moved = b.mesh.positions();
  int free = 0;
  int within = 0;
  for (size_t v = 0; v < band.size(); ++v) {
    if (band[v] == 0) continue;
    const bool is_within = free++ % 2 == 0;
    within += is_within ? 1 : 0;
    moved(static_cast<Eigen::Index>(v), 1) += is_within ? 0.999 * band[v] : 1.001 * band[v];
  }
  ASSERT_OK_AND_ASSIGN(b.mesh, TetMesh::Create(moved, b.mesh.tets()));
  ASSERT_THAT(WriteTetMesh(Path("b.vtu"), b), IsOk());
  const ProcessResult run = Run({"compare", "a.vtu", "b.vtu", "--json"});
  ASSERT_THAT(run, Succeeds());
  const auto count = nlohmann::json::parse(run.out)["within_material_uncertainty"];
  EXPECT_EQ(count["vertices"], free);
  EXPECT_EQ(count["within"], within);
  EXPECT_NEAR(count["largest_beyond_mm"].get<double>(),
              0.001 * *std::max_element(band.begin(), band.end()), 1e-5);
  EXPECT_THAT(Run({"compare", "a.vtu", "b.vtu"}).out, HasSubstr("excludes model and surgical"));
}

TEST_F(DeformTest, ElasticResultsReportReactionForcesAndStresses) {
  ASSERT_OK_AND_ASSIGN(const TetMeshFile rest, ReadTetMesh(TestDataPath("plans/bar/bar.vtu")));
  for (const std::string model : {"linear_elastic", "neo_hookean"}) {
    ASSERT_THAT(Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "out.vtu", "--model",
                     model, "--stats", "stats.json"}),
                Succeeds());
    ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("out.vtu")));
    const auto elastic = nlohmann::json::parse(Read("stats.json"))["elastic"];
    const Positions forces = Rows(result, "reaction_force_n");
    EXPECT_TRUE(forces.middleRows(25, 325 - 50).isZero(0)) << "free vertices";
    const Eigen::Vector3d fixed = VectorOf(elastic["fixed"]["force_n"]);
    const Eigen::Vector3d handle = VectorOf(elastic["handles"][0]["force_n"]);
    EXPECT_EQ(elastic["handles"][0]["name"], "top");
    EXPECT_LT((forces.topRows(25).colwise().sum().transpose() - fixed).norm(), 1e-12);
    EXPECT_LT((forces.bottomRows(25).colwise().sum().transpose() - handle).norm(), 1e-12);
    EXPECT_GT(handle.norm(), 1e-3);
    EXPECT_NEAR(elastic["unbalanced_force_n"].get<double>(), (fixed + handle).norm(), 1e-15);
    EXPECT_LT((fixed + handle).norm(), 1e-3 * handle.norm());
    EXPECT_NEAR(VectorOf(elastic["fixed"]["about_mm"]).z(),
                rest.mesh.positions().topRows(25).col(2).mean(), 1e-12);
    const std::vector<double> stress =
        ToDoubles(*FindAttribute(result.cell_data, "von_mises_stress_pa"));
    const auto& of_stress = elastic["von_mises_stress_pa"];
    EXPECT_EQ(of_stress["max"], *std::max_element(stress.begin(), stress.end()));
    EXPECT_EQ(of_stress["max"], stress[of_stress["max_tet"].get<size_t>()]);
    const auto share_below = [&](const char* percentile) {
      const double limit = of_stress[percentile].get<double>();
      return static_cast<double>(std::count_if(stress.begin(), stress.end(),
                                               [limit](double s) { return s <= limit; })) /
             static_cast<double>(stress.size());
    };
    EXPECT_NEAR(share_below("p50"), 0.50, 0.001);
    EXPECT_NEAR(share_below("p95"), 0.95, 0.001);
    const std::vector<double> strain =
        ToDoubles(*FindAttribute(result.cell_data, "principal_strain"));
    const auto& of_strain = elastic["principal_strain"];
    EXPECT_EQ(of_strain["max"], *std::max_element(strain.begin(), strain.end()));
    EXPECT_EQ(of_strain["min"], *std::min_element(strain.begin(), strain.end()));
    EXPECT_EQ(of_strain["max"], strain[3 * of_strain["max_tet"].get<size_t>()]);
    EXPECT_EQ(of_strain["min"], strain[3 * of_strain["min_tet"].get<size_t>() + 2]);
    const std::vector<double> density =
        ToDoubles(*FindAttribute(result.cell_data, "strain_energy_density_pa"));
    const double energy_nj =
        TetVolumes(rest.mesh.positions(), rest.mesh.tets())
            .dot(Eigen::Map<const Eigen::VectorXd>(density.data(), rest.mesh.num_tets()));
    EXPECT_NEAR(elastic["strain_energy_mj"].get<double>(), 1e-6 * energy_nj, 1e-13 * energy_nj);
  }
}

TEST_F(DeformTest, InvertedTetIsReported) {
  nlohmann::json plan = BarPlan();
  plan["handles"][0]["pose"] = {{"translation_mm", {0, 0, -70}}};
  std::filesystem::copy_file(TestDataPath("plans/bar/bar.vtu"), Path("bar.vtu"));
  Write("plan.json", plan.dump());
  const ProcessResult result = Run({"deform", "plan.json", "--out", "out.vtu"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("inverted, the worst is tet "));
}

TEST_F(DeformTest, UnreachableMovementIsReported) {
  nlohmann::json plan = BarPlan();
  plan["handles"][0]["pose"] = {{"translation_mm", {0, 0, -70}}};
  plan["model"] = "neo_hookean";
  std::filesystem::copy_file(TestDataPath("plans/bar/bar.vtu"), Path("bar.vtu"));
  Write("plan.json", plan.dump());
  const ProcessResult result =
      Run({"deform", "plan.json", "--out", "out.vtu", "--stats", "stats.json"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("% of the movement was reached"));
  const auto stats = nlohmann::json::parse(Read("stats.json"));
  EXPECT_LT(stats["load"].get<double>(), 1);
  EXPECT_EQ(stats["quality"]["inverted_tets"], 0);
}

TEST_F(DeformTest, ResultIsTheRestShapePlusItsDisplacement) {
  ASSERT_THAT(Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "out.vtu"}), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("out.vtu")));
  const TetMeshFile rest = BarMeshOfPlan();
  const Positions displacements = Displacements(result);
  ASSERT_EQ(displacements.rows(), rest.mesh.num_vertices());
  EXPECT_LT((rest.mesh.positions() + displacements - result.mesh.positions()).cwiseAbs().maxCoeff(),
            1e-12);
  EXPECT_EQ(result.mesh.tets(), rest.mesh.tets());
  EXPECT_TRUE(displacements.topRows(25).isZero(0)) << "fixed layer";
  EXPECT_GT(displacements.bottomRows(25).rowwise().norm().minCoeff(), 0.1) << "handle";
  EXPECT_THAT(Files(), ElementsAre("out.vtu"));
}

TEST_F(DeformTest, InputArraysAreKeptWithTheirTypesAndAnOldDisplacementIsReplaced) {
  TetMeshFile bar = BarMeshOfPlan();
  bar.point_data.push_back(
      {"displacement_mm", 1, std::vector<float>(static_cast<size_t>(bar.mesh.num_vertices()), 7)});
  ASSERT_THAT(WriteTetMesh(Path("bar.vtu"), bar), IsOk());
  Write("plan.json", BarPlan().dump());
  ASSERT_THAT(Run({"deform", "plan.json", "--out", "out.vtu"}), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("out.vtu")));
  EXPECT_EQ(result.point_data.size(), 2U);
  EXPECT_EQ(Displacements(result).rows(), bar.mesh.num_vertices());
  for (const char* name : {"youngs_modulus_pa", "material"}) {
    ASSERT_NE(FindAttribute(result.cell_data, name), nullptr);
    EXPECT_TRUE(FindAttribute(result.cell_data, name)->values ==
                FindAttribute(bar.cell_data, name)->values);
  }
  EXPECT_TRUE(FindAttribute(result.point_data, "anatomy")->values == bar.point_data[0].values);
}

TEST_F(DeformTest, RasPlanGivesTheLpsResultWrittenInRas) {
  TetMeshFile bar = BarMeshOfPlan();
  Positions positions = bar.mesh.positions();
  positions.leftCols<2>() *= -1;
  ASSERT_OK_AND_ASSIGN(bar.mesh, TetMesh::Create(positions, bar.mesh.tets()));
  ASSERT_THAT(WriteTetMesh(Path("bar.vtu"), bar), IsOk());
  nlohmann::json plan = BarPlan();
  plan["coordinate_system"] = "RAS";
  plan["handles"][0]["pose"]["pivot_mm"] = {-10, -10, 60};
  plan["handles"][0]["pose"]["translation_mm"] = {0, 6, 0};
  Write("plan.json", plan.dump());
  ASSERT_THAT(Run({"deform", "plan.json", "--out", "ras.vtu", "--model", "linear_elastic",
                   "--stats", "ras.json"}),
              Succeeds());
  ASSERT_THAT(Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "lps.vtu", "--model",
                   "linear_elastic", "--stats", "lps.json"}),
              Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile ras, ReadTetMesh(Path("ras.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile lps, ReadTetMesh(Path("lps.vtu")));
  const Eigen::Array3d signs(-1, -1, 1);
  const auto to_lps = [&signs](const Positions& p) {
    return Positions((p.array().rowwise() * signs.transpose()).matrix());
  };
  EXPECT_LT((to_lps(ras.mesh.positions()) - lps.mesh.positions()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((to_lps(Displacements(ras)) - Displacements(lps)).cwiseAbs().maxCoeff(), 1e-12);
  const Positions forces = Rows(lps, "reaction_force_n");
  EXPECT_LT((to_lps(Rows(ras, "reaction_force_n")) - forces).norm(), 1e-10 * forces.norm());
  for (const char* vector : {"force_n", "moment_n_mm", "about_mm"}) {
    const auto of_handle = [&](const char* file) {
      return VectorOf(nlohmann::json::parse(Read(file))["elastic"]["handles"][0][vector]);
    };
    const Eigen::Vector3d in_lps = of_handle("lps.json");
    const Eigen::Vector3d in_ras = of_handle("ras.json").array() * signs;
    EXPECT_LT((in_ras - in_lps).norm(), 1e-9 * (1 + in_lps.norm())) << vector;
  }
}

TEST_F(DeformTest, StatsReportCountsTimesAndQuality) {
  ASSERT_THAT(Run({"deform", TestDataPath("plans/tongue/plan.json"), "--out", "out.vtu", "--stats",
                   "stats.json"}),
              Succeeds());
  const nlohmann::json stats = nlohmann::json::parse(Read("stats.json"));
  EXPECT_EQ(stats["model"], "gradient_field");
  EXPECT_EQ(stats["counts"]["vertices"], 2238);
  EXPECT_EQ(stats["counts"]["tets"], 10980);
  EXPECT_EQ(stats["counts"]["free_vertices"].get<int>() +
                stats["counts"]["fixed_vertices"].get<int>() +
                stats["counts"]["handle_vertices"].get<int>(),
            2238);
  for (const char* stage : {"read", "assemble", "analyse", "factorise", "prepare", "solve"}) {
    EXPECT_GE(stats["seconds"][stage].get<double>(), 0) << stage;
  }
  EXPECT_EQ(stats["converged"], true);
  EXPECT_LT(stats["residual"].get<double>(), 1e-10);
  EXPECT_GT(stats["bytes_held"].get<int64_t>(), 0);
  EXPECT_EQ(stats["quality"]["inverted_tets"], 0);
  EXPECT_LE(stats["quality"]["volume_ratio_min"].get<double>(), 1);
  EXPECT_THAT(stats["notice"].get<std::string>(), HasSubstr("not a medical device"));
  EXPECT_THAT(Files(), ElementsAre("out.vtu", "stats.json"));
}

TEST_F(DeformTest, NamedModelReplacesThatOfThePlan) {
  EXPECT_THAT(Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "out.vtu", "--model",
                   "gradient_field"}),
              Succeeds());
  EXPECT_THAT(
      Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "no.vtu", "--model", "jelly"}),
      FailsWith(2, HasSubstr("jelly")));
  EXPECT_THAT(Files(), ElementsAre("out.vtu"));
}

TEST_F(DeformTest, OneSolverThreadIsTheDefaultToTheByteAndTwoAgree) {
  const auto deform = [this](const std::string& out, std::vector<std::string> more) {
    std::vector<std::string> words = {"deform",  TestDataPath("plans/tongue/plan.json"),
                                      "--out",   out + ".vtu",
                                      "--model", "linear_elastic",
                                      "--stats", out + ".json"};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_THAT(Run(words), Succeeds());
    return nlohmann::json::parse(Read(out + ".json"))["solver_threads"].get<int>();
  };
  EXPECT_EQ(deform("unsaid", {}), 1);
  EXPECT_EQ(deform("one", {"--solver-threads", "1"}), 1);
  EXPECT_EQ(deform("two", {"--solver-threads", "2"}), 2);
  EXPECT_EQ(Read("one.vtu"), Read("unsaid.vtu"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile one, ReadTetMesh(Path("one.vtu")));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile two, ReadTetMesh(Path("two.vtu")));
  EXPECT_LT((one.mesh.positions() - two.mesh.positions()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(DeformTest, PlanCheckSummarizesThePlannedMovement) {
  const ProcessResult result = Run({"plan", "check", TestDataPath("plans/bar/plan.json")});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, HasSubstr("top: 25 vertices, moves 6 mm, turns 45 degrees"));
  EXPECT_THAT(result.out, ::testing::Not(HasSubstr("warning")));
}

TEST_F(DeformTest, PlanCheckWarnsOfAMeshThatIsProbablyNotInMillimeters) {
  WriteBar();
  ASSERT_OK_AND_ASSIGN(TetMeshFile bar, ReadTetMesh(Path("bar.vtu")));
  bar.mesh = *TetMesh::Create(bar.mesh.positions() / 1000, bar.mesh.tets());
  ASSERT_THAT(WriteTetMesh(Path("bar.vtu"), bar), IsOk());
  Write("plan.json", BarPlan().dump());
  const ProcessResult result = Run({"plan", "check", "plan.json"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, HasSubstr("warning    the diagonal of the bounding box is 0.0"));
}

// A block with a mouth: what sticks has the answer of the block that was never parted.
TEST_F(DeformTest, ContactIsReportedAndCanBeTurnedOff) {
  const PartedBlock block;
  nlohmann::json plan = BarPlan();
  plan.erase("uncertainty");
  plan["version"] = 4;
  plan["mesh"] = "block.vtu";
  plan["stiffness"] = {{"uniform", 9000}};
  plan["model"] = "linear_elastic";
  plan["fixed"] = {{"vertices", PartedBlock::Fixed()}};
  plan["handles"] = {{{"name", "top"},
                      {"region", {{"vertices", PartedBlock::Top()}}},
                      {"pose", {{"translation_mm", {0.05, -0.1, -0.4}}}}}};
  plan["contact"] = ContactToJson(block.rows, {"top"}, CoordinateSystem::kLps);
  Write("plan.json", plan.dump());
  plan.erase("contact");
  plan["mesh"] = "whole.vtu";
  Write("whole.json", plan.dump());
  ASSERT_THAT(
      WriteTetMesh(Path("block.vtu"), {.mesh = block.mesh, .point_data = {}, .cell_data = {}}),
      IsOk());
  ASSERT_THAT(WriteTetMesh(Path("whole.vtu"),
                           {.mesh = PartedBlock::Whole(), .point_data = {}, .cell_data = {}}),
              IsOk());

  const ProcessResult on = Run({"deform", "plan.json", "--out", "on.vtu", "--stats", "on.json"});
  EXPECT_THAT(on, Succeeds());
  EXPECT_THAT(on.out, HasSubstr("press, largest force"));
  const nlohmann::json of_on = nlohmann::json::parse(Read("on.json"));
  EXPECT_EQ(of_on["contact"]["use"], "on");
  EXPECT_EQ(of_on["contact"]["rows"], block.rows.size());
  EXPECT_GT(of_on["contact"]["pressing_rows"], 0);
  EXPECT_GT(of_on["contact"]["max_force_n"], 0);
  EXPECT_LT(of_on["contact"]["residual_mm"], 1e-6);
  // All that holds the tissue is in balance.
  EXPECT_LT(of_on["elastic"]["unbalanced_force_n"], 1e-9);

  EXPECT_THAT(Run({"plan", "check", "plan.json"}).out, HasSubstr("contact    10 rows, of them 3"));
  const ProcessResult off =
      Run({"deform", "plan.json", "--out", "off.vtu", "--stats", "off.json", "--contact", "off"});
  EXPECT_THAT(off, Succeeds());
  EXPECT_THAT(off.out, HasSubstr("contact: off"));
  EXPECT_EQ(nlohmann::json::parse(Read("off.json"))["contact"]["use"], "off");
  EXPECT_THAT(Run({"deform", "whole.json", "--out", "never.vtu", "--stats", "never.json"}),
              Succeeds());
  EXPECT_FALSE(nlohmann::json::parse(Read("never.json")).contains("contact"));
  EXPECT_EQ(Read("off.vtu"), Read("never.vtu")) << "to the last byte";
  EXPECT_NE(Read("off.vtu"), Read("on.vtu"));
}

TEST_F(DeformTest, WithContactOffTheResultArrayHasNoContacts) {
  const std::string plan = TestDataPath("plans/head_lips/plan.json");
  const auto contact_of = [&](const std::string& use) {
    EXPECT_THAT(Run({"deform", plan, "--out", "a.vtu", "--contact", use}), Succeeds());
    const absl::StatusOr<TetMeshFile> result = ReadTetMesh(Path("a.vtu"));
    return ToDoubles(*FindAttribute(result->point_data, "contact"));
  };
  const std::vector<double> on = contact_of("on");
  EXPECT_GT(std::ranges::count(on, 1.0), 100);
  const std::vector<double> off = contact_of("off");
  EXPECT_EQ(std::ranges::count(off, 0.0), static_cast<ptrdiff_t>(off.size()));
}

TEST_F(DeformTest, FullBandNamesItsPartsAndUsesAClinicsDeviations) {
  const std::string plan = TestDataPath("plans/head_chin/plan.json");
  const auto place_of = [&](const std::vector<std::string>& more, const std::string& name) {
    std::vector<std::string> args = {"deform",         plan,      "--out", "a.vtu", "--model",
                                     "linear_elastic", "--stats", "a.json"};
    args.insert(args.end(), more.begin(), more.end());
    const ProcessResult result = Run(args);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr("; of this surgery "));
    const auto places = nlohmann::json::parse(Read("a.json"))["uncertainty"]["places"];
    const auto found =
        std::ranges::find_if(places, [&](const auto& place) { return place["name"] == name; });
    EXPECT_NE(found, places.end());
    return *found;
  };
  const nlohmann::json published = place_of({}, "chin");
  EXPECT_LT(published["low_mm"], published["movement_mm"]);
  EXPECT_GT(published["high_mm"], published["movement_mm"]);
  EXPECT_GT(published["surgery_mm"], 0.1);
  // The nose does not move: its interval is along the normal, 1.96 standard deviations.
  EXPECT_NEAR(place_of({}, "nose")["model_mm"], 1.96 * 0.89, 0.05);
  Write("exact.json", R"({"surgery": {"translation_mm": [0, 0, 0], "rotation_deg": [0, 0, 0]},
                          "model_mm": {"default": 0, "lower_lip": 0, "upper_lip": 0}})");
  EXPECT_EQ(SchemaFindings("deviations.schema.json", "exact.json", {"", "surgery", "model_mm"}),
            "");
  const nlohmann::json exact = place_of({"--deviations", "exact.json"}, "chin");
  EXPECT_EQ(exact["surgery_mm"], 0);
  EXPECT_EQ(exact["model_mm"], 0);
  EXPECT_LT(exact["high_mm"].get<double>() - exact["low_mm"].get<double>(), 0.5);

  // One operation's figures; what it leaves out is as of all.
  Write("own.json", R"({"model_mm": {"nose": 1}, "source": "ours",
                        "operations": {"bsso": {"model_mm": {"chin": 0}}}})");
  EXPECT_EQ(SchemaFindings("deviations.schema.json", "own.json",
                           {"", "surgery", "model_mm", "operations", "bsso"}),
            "");
  const std::vector<std::string> bsso = {"--deviations", "own.json", "--operation", "bsso"};
  EXPECT_EQ(place_of(bsso, "chin")["model_mm"], 0);
  EXPECT_NEAR(place_of(bsso, "nose")["model_mm"], 1.96, 0.05);
  EXPECT_EQ(nlohmann::json::parse(Read("a.json"))["uncertainty"]["deviations"]["source"],
            "ours, bsso");
  EXPECT_GT(place_of({"--deviations", "own.json"}, "chin")["model_mm"], 0.1);
  // Published of one operation: 0.9 mm of mean absolute distance.
  EXPECT_NEAR(place_of({"--operation", "bsso_forward"}, "nose")["model_mm"],
              1.96 * 0.9 / std::sqrt(2 / std::numbers::pi), 0.05);
  const ProcessResult unused =
      Run({"deform", plan, "--out", "b.vtu", "--model", "arap", "--operation", "bsso_forward"});
  EXPECT_THAT(unused.err, HasSubstr("change nothing: arap has no intervals"));
  const ProcessResult unknown =
      Run({"deform", plan, "--out", "a.vtu", "--deviations", "own.json", "--operation", "lefort"});
  EXPECT_NE(unknown.exit_code, 0);
  EXPECT_THAT(unknown.err, HasSubstr("no deviations of the operation \"lefort\"; known are: bsso"));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("a.vtu")));
  EXPECT_NE(FindAttribute(result.point_data, "total_uncertainty_p95_mm"), nullptr);
}

TEST_F(DeformTest, RefusesInvalidDeviationsInOneLine) {
  const std::string plan = TestDataPath("plans/head_chin/plan.json");
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"[]", "is not a JSON object"},
      {R"({"surgery": {"translation": [1, 1, 1]}})", "unknown key \"translation\""},
      {R"({"surgery": {"translation_mm": [1, 1]}})", "needs three numbers"},
      {R"({"model_mm": {"chin": -1}})", "\"chin\" needs numbers from 0 to 100"},
      {R"({"model_mm": {"chn": 1}})", "unknown place \"chn\" in \"model_mm\"; allowed: default,"},
      {R"({"model": 3})", "key \"model\" is not known"},
      {R"({"operations": {"le fort": {}}})", "letters, digits, - and _"},
      {R"({"operations": {"bsso": {"operations": {}}}})", "key \"operations\" is not known"},
      {R"({"operations": {"bsso": {"model_mm": {"chn": 1}}}})", "unknown place \"chn\""},
      {R"({"source": )", "deviations wrong.json"}};
  for (const auto& [text, message] : wrong) {
    Write("wrong.json", text);
    const ProcessResult result =
        Run({"deform", plan, "--out", "a.vtu", "--deviations", "wrong.json"});
    EXPECT_NE(result.exit_code, 0);
    EXPECT_THAT(result.err, HasSubstr(message));
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    EXPECT_NE(SchemaFindings("deviations.schema.json", "wrong.json", {"", "surgery", "model_mm"}),
              "");
  }
}

TEST_F(DeformTest, LipsAreSealedWhenAskedAndTheResultSaysSo) {
  const PartedBlock block;
  ASSERT_THAT(
      WriteTetMesh(Path("mesh.vtu"), {.mesh = block.mesh, .point_data = {}, .cell_data = {}}),
      IsOk());
  nlohmann::json plan = BarPlan();
  plan.erase("mesh_sha256");
  plan["version"] = 4;
  plan["mesh"] = "mesh.vtu";
  plan["model"] = "linear_elastic";
  plan["stiffness"] = {{"uniform", 15000}};
  plan["fixed"] = {{"vertices", PartedBlock::Fixed()}};
  plan["handles"] = {{{"name", "top"},
                      {"region", {{"vertices", PartedBlock::Top()}}},
                      {"pose", {{"translation_mm", {0.0, 0.0, 0.5}}}}}};
  plan["contact"] = ContactToJson(block.rows, {"top"}, CoordinateSystem::kLps);
  const auto seal = [this](const std::vector<std::string>& more) {
    std::vector<std::string> args = {"deform", "plan.json", "--out", "a.vtu", "--seal"};
    args.insert(args.end(), more.begin(), more.end());
    return Run(args);
  };
  Write("plan.json", plan.dump());
  EXPECT_THAT(seal({}).err, HasSubstr("has no \"seal\" in \"contact\""));

  plan["contact"]["seal"] = LipEdgeToJson(block.Edge(), CoordinateSystem::kLps);
  Write("plan.json", plan.dump());
  const ProcessResult sealed = seal({"--stats", "sealed.json"});
  ASSERT_THAT(sealed, Succeeds());
  EXPECT_THAT(sealed.out, HasSubstr(", sealed: 3 pairs, released: no\n"));
  const auto stats = nlohmann::json::parse(Read("sealed.json"))["contact"]["seal"];
  EXPECT_EQ(stats["pairs"], 3);
  EXPECT_EQ(stats["released"], false);
  EXPECT_GT(stats["parted_mm"], 0.1);
  ASSERT_OK_AND_ASSIGN(const TetMeshFile result, ReadTetMesh(Path("a.vtu")));
  const std::vector<double> marks = ToDoubles(*FindAttribute(result.point_data, "lip_seal"));
  const LipEdge edge = block.Edge();
  EXPECT_EQ(std::ranges::count(marks, 0.0), static_cast<std::ptrdiff_t>(marks.size()) - 6);
  EXPECT_EQ(marks[static_cast<size_t>(edge.pairs[0].upper)], 1);
  EXPECT_EQ(marks[static_cast<size_t>(edge.pairs[0].lower)], 2);

  plan["handles"][0]["pose"]["translation_mm"] = {0, 0, 40};
  Write("plan.json", plan.dump());
  const ProcessResult released = seal({});
  ASSERT_EQ(released.exit_code, 0);  // with a warning: tets are inverted
  EXPECT_THAT(released.out, HasSubstr("sealed: 0 of 3 pairs, released: yes (parted by "));
  ASSERT_OK_AND_ASSIGN(const TetMeshFile open, ReadTetMesh(Path("a.vtu")));
  EXPECT_EQ(std::ranges::count(ToDoubles(*FindAttribute(open.point_data, "lip_seal")), 3.0), 6);

  EXPECT_THAT(seal({"--contact", "off"}).err, HasSubstr("--contact off joins them"));
  EXPECT_THAT(seal({"--model", "arap"}).err, HasSubstr("arap does not compute the lip seal"));
  for (const std::string command : {"compare", "export"}) {
    EXPECT_THAT(
        Run({command, "plan.json", "--seal"}).err,
        HasSubstr("this command does not compute the lip seal; use tissueform deform, plan fit, "
                  "run or drag"));
  }
}

TEST_F(DeformTest, ContactIsOnOrOff) {
  WriteBar();
  const ProcessResult result =
      Run({"deform", TestDataPath("plans/bar/plan.json"), "--out", "a.vtu", "--contact", "maybe"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--contact"));
}

}  // namespace
}  // namespace tissueform::testing
