// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/planning/case_file/case_writer.h"
#include "core/planning/case_file/predicted_case.h"
#include "core/planning/plan_io.h"
#include "core/planning/selector.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/core/planning/plan_text.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using tissueform::testing::Bar;
using tissueform::testing::GoodPlan;
using tissueform::testing::IsOk;
using tissueform::testing::Parse;
using tissueform::testing::PlanWith;
using tissueform::testing::StatusIs;

// A bar of 2 x 2 x 4 mm beside the plan, with arrays.
class PlanResolverTest : public ::testing::Test {
 protected:
  PlanResolverTest() : bar_(Bar({2, 2, 4}, 1.0, 0.1)) {}

  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(::testing::TempDir()) / "plan_resolver_test" / info->name();
    std::filesystem::create_directories(folder_);
    WriteMesh(bar_, std::vector<double>(static_cast<size_t>(bar_.num_tets()), 2000));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void WriteMesh(const TetMesh& mesh, std::vector<double> pa) {
    std::vector<int32_t> anatomy(static_cast<size_t>(mesh.num_vertices()), 0);
    anatomy.front() = 1;
    anatomy.back() = 2;
    std::vector<uint8_t> part(static_cast<size_t>(mesh.num_tets()), 1);
    part.back() = 2;
    const std::vector<float> wide(static_cast<size_t>(3 * mesh.num_vertices()), 0.0F);
    ASSERT_THAT(WriteTetMesh((folder_ / "mesh.vtu").string(),
                             {.mesh = mesh,
                              .point_data = {{"anatomy", 1, anatomy}, {"wide", 3, wide}},
                              .cell_data = {{"pa", 1, std::move(pa)}, {"part", 1, part}}}),
                IsOk());
  }

  absl::StatusOr<PlanProblem> Resolve(const nlohmann::json& json) {
    absl::StatusOr<Plan> plan = Parse(json, folder_.string());
    if (!plan.ok()) return plan.status();
    return ResolvePlan(*plan);
  }

  TetMesh bar_;
  std::filesystem::path folder_;
};

auto IsRefused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
}

TEST_F(PlanResolverTest, BoxesSelectTheEndsOfABar) {
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, Resolve(GoodPlan()));
  EXPECT_THAT(problem.constraints.fixed(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  ASSERT_THAT(problem.constraints.handles(), SizeIs(1));
  EXPECT_EQ(problem.constraints.handles()[0].vertices.front(), 36);
  EXPECT_EQ(problem.mesh->positions(), bar_.positions());
  EXPECT_THAT(std::vector<double>(problem.stiffness.begin(), problem.stiffness.end()), Each(15000));
  EXPECT_THAT(problem.point_data, SizeIs(2));
  EXPECT_THAT(problem.cell_data, SizeIs(2));
}

TEST_F(PlanResolverTest, MeshOfACaseIsReadAndHeldToItsDigest) {
  const CaseFile contents = SampleCase();
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(contents));
  std::ofstream(folder_ / "head.tfcase", std::ios::binary) << bytes;
  nlohmann::json plan = GoodPlan();
  plan["version"] = 3;
  plan["mesh"] = "head.tfcase";
  plan["mesh_sha256"] = contents.mesh.name.substr(std::string("meshes/").size());
  plan["stiffness"] = {{"cell_data", "stiffness"}};
  plan["fixed"] = {{"vertices", {0, 1}}};
  plan["handles"][0]["region"] = {{"vertices", {44}}};
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, Resolve(plan));
  EXPECT_EQ(problem.mesh->positions(), RestPositions(contents.mesh));
  EXPECT_EQ(problem.mesh->num_tets(), contents.mesh.tet_count);
  EXPECT_THAT(std::vector<double>(problem.stiffness.begin(), problem.stiffness.end()), Each(1));

  plan["mesh_sha256"] = std::string(64, 'a');
  EXPECT_THAT(Resolve(plan), IsRefused("head.tfcase: not the plan's mesh"));
  std::filesystem::resize_file(folder_ / "head.tfcase", bytes.size() / 2);
  EXPECT_THAT(Resolve(plan), IsRefused("head.tfcase"));
  std::filesystem::remove(folder_ / "head.tfcase");
  EXPECT_THAT(Resolve(plan), StatusIs(absl::StatusCode::kNotFound,
                                      HasSubstr("head.tfcase does not exist; save it there")));
}

TEST_F(PlanResolverTest, MeshFileIsHeldToTheDigestThatServersNameItBy) {
  nlohmann::json plan = PlanWith("/stiffness", {{"cell_data", "pa"}});
  plan["version"] = 3;
  const CellArray stiffness = {"pa", Eigen::VectorXd::Constant(bar_.num_tets(), 2000)};
  plan["mesh_sha256"] = ViewMeshPayload(bar_.positions(), bar_.tets(), {stiffness}).Sha256();
  EXPECT_THAT(Resolve(plan).status(), IsOk());
  plan["mesh_sha256"] = std::string(64, '0');
  EXPECT_THAT(Resolve(plan), IsRefused("mesh.vtu: not the plan's mesh"));
}

TEST_F(PlanResolverTest, BoxIsClosed) {
  const Eigen::RowVector3d v = bar_.positions().row(7);
  const nlohmann::json corner = {v[0], v[1], v[2]};
  ASSERT_OK_AND_ASSIGN(
      const PlanProblem problem,
      Resolve(PlanWith("/fixed", {{"box_mm", {{"min", corner}, {"max", corner}}}})));
  EXPECT_THAT(problem.constraints.fixed(), ElementsAre(7));
}

TEST_F(PlanResolverTest, UnionIsTheSetOfItsParts) {
  ASSERT_OK_AND_ASSIGN(
      const PlanProblem problem,
      Resolve(PlanWith(
          "/fixed",
          nlohmann::json::parse(
              R"({"union": [{"vertices": [5, 3, 5]}, {"point_data": "anatomy", "equals": 1},
                                                   {"union": [{"vertices": [3, 4]}]}]})"))));
  EXPECT_THAT(problem.constraints.fixed(), ElementsAre(0, 3, 4, 5));
}

TEST_F(PlanResolverTest, EmptySelectionNamesItsRegion) {
  const nlohmann::json nowhere = {{"box_mm", {{"min", {50, 50, 50}}, {"max", {60, 60, 60}}}}};
  EXPECT_THAT(Resolve(PlanWith("/fixed", nowhere)), IsRefused("fixed selects no vertex"));
  EXPECT_THAT(Resolve(PlanWith("/handles/0/region", nowhere)),
              IsRefused("handle \"top\" selects no vertex"));
  EXPECT_THAT(Resolve(PlanWith("/fixed", {{"point_data", "anatomy"}, {"equals", 9}})),
              IsRefused("fixed selects no vertex"));
}

TEST_F(PlanResolverTest, VertexOutOfRangeIsNamed) {
  EXPECT_THAT(Resolve(PlanWith("/fixed", {{"vertices", {0, 45}}})),
              IsRefused("fixed: vertex 45 does not exist"));
}

TEST_F(PlanResolverTest, OverlappingRegionsAreRefused) {
  EXPECT_THAT(Resolve(PlanWith("/handles/0/region", {{"vertices", {3}}})), IsRefused("vertex 3"));
}

TEST_F(PlanResolverTest, TwoHandlesOfOneNameAreRefused) {
  nlohmann::json plan = GoodPlan();
  plan["handles"].push_back({{"name", "top"}, {"region", {{"vertices", {20}}}}});
  EXPECT_THAT(Resolve(plan), IsRefused("top"));
}

TEST_F(PlanResolverTest, BoxTheWrongWayRoundIsRefused) {
  EXPECT_THAT(Resolve(PlanWith("/fixed", {{"box_mm", {{"min", {1, 0, 0}}, {"max", {0, 1, 1}}}}})),
              IsRefused("min above max"));
}

TEST_F(PlanResolverTest, MissingArrayIsNamedWithTheExistingOnes) {
  EXPECT_THAT(Resolve(PlanWith("/fixed", {{"point_data", "anatmy"}, {"equals", 1}})),
              IsRefused("no point array \"anatmy\"; it has anatomy, wide"));
  EXPECT_THAT(Resolve(PlanWith("/fixed", {{"point_data", "wide"}, {"equals", 0}})),
              IsRefused("\"wide\" has 3 components"));
  EXPECT_THAT(Resolve(PlanWith("/stiffness", {{"cell_data", "young"}})),
              IsRefused("stiffness: the mesh has no cell array \"young\""));
}

TEST_F(PlanResolverTest, StiffnessComesFromAnArray) {
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem,
                       Resolve(PlanWith("/stiffness", {{"cell_data", "pa"}})));
  EXPECT_THAT(std::vector<double>(problem.stiffness.begin(), problem.stiffness.end()), Each(2000));
}

TEST_F(PlanResolverTest, StiffnessComesFromLabels) {
  ASSERT_OK_AND_ASSIGN(
      const PlanProblem problem,
      Resolve(PlanWith(
          "/stiffness",
          nlohmann::json::parse(R"({"by_cell_data": "part", "values": {"1": 5, "2": 7}})"))));
  EXPECT_EQ(problem.stiffness[0], 5);
  EXPECT_EQ(problem.stiffness[bar_.num_tets() - 1], 7);
}

TEST_F(PlanResolverTest, LabelWithoutStiffnessNamesItsTet) {
  EXPECT_THAT(
      Resolve(PlanWith("/stiffness",
                       nlohmann::json::parse(R"({"by_cell_data": "part", "values": {"1": 5}})"))),
      IsRefused("tet 95 has part = 2"));
}

TEST_F(PlanResolverTest, StiffnessOfAnArrayMustBePositiveAndFinite) {
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    std::vector<double> pa(static_cast<size_t>(bar_.num_tets()), 2000);
    pa[4] = bad;
    WriteMesh(bar_, pa);
    EXPECT_THAT(Resolve(PlanWith("/stiffness", {{"cell_data", "pa"}})), IsRefused("tet 4 has"));
  }
}

TEST_F(PlanResolverTest, MissingMeshIsNotFound) {
  EXPECT_THAT(Resolve(PlanWith("/mesh", "other.vtu")),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("other.vtu")));
}

TEST_F(PlanResolverTest, MeshThatNoDeformerTakesIsRefused) {
  TetIndices inverted = bar_.tets();
  std::swap(inverted(3, 0), inverted(3, 1));
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(bar_.positions(), inverted));
  WriteMesh(mesh, std::vector<double>(static_cast<size_t>(mesh.num_tets()), 1));
  EXPECT_THAT(Resolve(GoodPlan()), StatusIs(absl::StatusCode::kInvalidArgument,
                                            AllOf(HasSubstr("mesh.vtu"), HasSubstr("tet"))));
}

TEST_F(PlanResolverTest, NonFiniteVertexIsRefused) {
  Positions positions = bar_.positions();
  positions(20, 0) = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, bar_.tets()));
  WriteMesh(mesh, std::vector<double>(static_cast<size_t>(mesh.num_tets()), 1));
  EXPECT_THAT(Resolve(GoodPlan()), IsRefused("20"));
}

TEST_F(PlanResolverTest, ComponentWithoutConstraintIsRefused) {
  Positions positions(2 * bar_.num_vertices(), 3);
  positions << bar_.positions(), bar_.positions().rowwise() + Eigen::RowVector3d(100, 0, 0);
  TetIndices tets(2 * bar_.num_tets(), 4);
  tets << bar_.tets(), bar_.tets().array() + static_cast<int32_t>(bar_.num_vertices());
  ASSERT_OK_AND_ASSIGN(const TetMesh two_bars, TetMesh::Create(positions, tets));
  WriteMesh(two_bars, std::vector<double>(static_cast<size_t>(two_bars.num_tets()), 1));
  EXPECT_THAT(Resolve(GoodPlan()), IsRefused("component"));
}

// The same situation described in RAS: mesh, boxes and pose with x and y negated.
TEST_F(PlanResolverTest, RasPlanGivesTheSamePredictionAsItsLpsTwin) {
  ASSERT_OK_AND_ASSIGN(const PlanProblem lps, Resolve(GoodPlan()));

  Positions positions = bar_.positions();
  positions.leftCols<2>() *= -1;
  ASSERT_OK_AND_ASSIGN(const TetMesh ras_bar, TetMesh::Create(positions, bar_.tets()));
  WriteMesh(ras_bar, std::vector<double>(static_cast<size_t>(bar_.num_tets()), 2000));
  nlohmann::json json = PlanWith("/coordinate_system", "RAS");
  json["fixed"]["box_mm"] = {{"min", {-9, -1.5, -9}}, {"max", {9, 9, 0.5}}};
  json["handles"][0]["pose"]["rotation_vector_deg"] = {-10, 20, 90};
  json["handles"][0]["pose"]["pivot_mm"] = {-1, -2, 4};
  json["handles"][0]["pose"]["translation_mm"] = {-0.5, 1, 2};
  ASSERT_OK_AND_ASSIGN(const PlanProblem ras, Resolve(json));

  json["coordinate_system"] = "LPS";
  WriteMesh(bar_, std::vector<double>(static_cast<size_t>(bar_.num_tets()), 2000));
  json["fixed"]["box_mm"] = {{"min", {-9, -9, -9}}, {"max", {9, 1.5, 0.5}}};
  json["handles"][0]["pose"]["rotation_vector_deg"] = {10, -20, 90};
  json["handles"][0]["pose"]["pivot_mm"] = {1, 2, 4};
  json["handles"][0]["pose"]["translation_mm"] = {0.5, -1, 2};
  ASSERT_OK_AND_ASSIGN(const PlanProblem twin, Resolve(json));

  EXPECT_EQ(ras.mesh->positions(), twin.mesh->positions());
  EXPECT_EQ(ras.constraints.fixed(), twin.constraints.fixed());
  EXPECT_LT(ras.constraints.fixed().size(), lps.constraints.fixed().size());
  ASSERT_OK_AND_ASSIGN(const auto ras_deformer,
                       CreateDeformer(*ras.mesh, ras.stiffness, ras.constraints, ras.deformer));
  ASSERT_OK_AND_ASSIGN(const auto twin_deformer,
                       CreateDeformer(*twin.mesh, twin.stiffness, twin.constraints, twin.deformer));
  ASSERT_OK_AND_ASSIGN(const Deformation from_ras, ras_deformer->Deform(ras.poses));
  ASSERT_OK_AND_ASSIGN(const Deformation from_lps, twin_deformer->Deform(twin.poses));
  EXPECT_LT((from_ras.positions - from_lps.positions).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(ras.written_in, CoordinateSystem::kRas);
}

TEST(CoordinatesTest, BoxKeepsMinBelowMax) {
  const SelectBox box = SwapToOrFromLps(CoordinateSystem::kRas, SelectBox{{1, 2, 3}, {4, 5, 6}});
  EXPECT_EQ(box.min_mm, Eigen::Vector3d(-4, -5, 3));
  EXPECT_EQ(box.max_mm, Eigen::Vector3d(-1, -2, 6));
}

class TissueRangesTest : public PlanResolverTest {
 protected:
  absl::StatusOr<MaterialUncertainty> Ranges(const nlohmann::json& uncertainty,
                                             const nlohmann::json& stiffness = {
                                                 {"cell_data", "pa"}}) {
    nlohmann::json plan = PlanWith("/uncertainty", uncertainty);
    plan["version"] = 2;
    plan["stiffness"] = stiffness;
    TF_ASSIGN_OR_RETURN(PlanProblem problem, Resolve(plan));
    return *std::move(problem.uncertainty);
  }
};

TEST_F(TissueRangesTest, FactorsGoByLabelsInTheirOrder) {
  ASSERT_OK_AND_ASSIGN(
      const MaterialUncertainty ranges,
      Ranges({{"youngs_modulus_factor_95",
               {{"by_cell_data", "part"}, {"values", {{"2", 1.5}, {"1", 3}, {"7", 2}}}}},
              {"poisson_ratio_95", {0.4, 0.49}}}));
  ASSERT_THAT(ranges.tissues, SizeIs(2));
  EXPECT_EQ(ranges.tissues[0].name, "part 1");
  EXPECT_EQ(ranges.tissues[0].factor_95, 3);
  EXPECT_EQ(ranges.tissues[1].name, "part 2");
  EXPECT_EQ(ranges.tissues[1].factor_95, 1.5);
  EXPECT_EQ(ranges.tissue_of_tet.front(), 0);
  EXPECT_EQ(ranges.tissue_of_tet.back(), 1);
  EXPECT_EQ(ranges.poisson_ratio_95->at(1), 0.49);
}

TEST_F(TissueRangesTest, OneFactorIsThatOfEveryTissueByItself) {
  const nlohmann::json twice = {{"youngs_modulus_factor_95", 2}};
  ASSERT_OK_AND_ASSIGN(
      MaterialUncertainty ranges,
      Ranges(twice, {{"by_cell_data", "part"}, {"values", {{"1", 9000}, {"2", 9000}}}}));
  EXPECT_THAT(ranges.tissues, SizeIs(2));
  EXPECT_EQ(ranges.tissues[1].factor_95, 2);
  std::vector<double> pa(static_cast<size_t>(bar_.num_tets()), 2000);
  pa.front() = 5000;
  WriteMesh(bar_, pa);
  ASSERT_OK_AND_ASSIGN(ranges, Ranges(twice));
  ASSERT_THAT(ranges.tissues, SizeIs(2));
  EXPECT_EQ(ranges.tissues[1].name, "5000 Pa");
  EXPECT_EQ(ranges.tissue_of_tet.front(), 1);
}

TEST_F(TissueRangesTest, NamesRangesThatDoNotFitTheMesh) {
  EXPECT_THAT(
      Ranges({{"youngs_modulus_factor_95", {{"by_cell_data", "part"}, {"values", {{"1", 2}}}}}}),
      IsRefused("has part = 2, which has no factor; add it to values"));
  EXPECT_THAT(
      Ranges({{"youngs_modulus_factor_95", {{"by_cell_data", "kind"}, {"values", {{"1", 2}}}}}}),
      IsRefused("uncertainty/youngs_modulus_factor_95: "));
  EXPECT_THAT(Ranges({{"poisson_ratio_95", {0.3, 0.4}}}),
              IsRefused("[0.3, 0.4] must be ascending and contain poisson_ratio, which is 0.45"));
  EXPECT_THAT(Ranges({{"poisson_ratio_95", {0.49, 0.4}}}), IsRefused("must be ascending"));
  std::vector<double> pa(static_cast<size_t>(bar_.num_tets()));
  std::iota(pa.begin(), pa.end(), 1000);
  WriteMesh(bar_, pa);
  EXPECT_THAT(Ranges({{"youngs_modulus_factor_95", 2}}),
              IsRefused("more than 16 kinds of tissue; use a cell array of labels"));
}

}  // namespace
}  // namespace tissueform
