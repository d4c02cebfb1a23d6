// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/planned_contact.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/planning/plan_io.h"
#include "core/planning/plan_schema.h"
#include "tests/core/planning/plan_text.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

// Contact rows from the text of a plan to its problem.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::tissueform::testing::GoodPlan;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::Parse;
using ::tissueform::testing::PartedBlock;
using ::tissueform::testing::RandomNumbers;
using ::tissueform::testing::StatusIs;

using Json = nlohmann::json;

Json PlanOfBlock(const std::vector<ContactRow>& rows,
                 CoordinateSystem system = CoordinateSystem::kLps) {
  Json plan = GoodPlan();
  if (!rows.empty()) {
    plan["version"] = 4;
    plan["contact"] = ContactToJson(rows, {"top"}, system);
  }
  plan["model"] = "linear_elastic";
  plan["fixed"] = {{"vertices", PartedBlock::Fixed()}};
  plan["handles"][0]["region"] = {{"vertices", PartedBlock::Top()}};
  plan["handles"][0]["pose"] = {{"translation_mm", {0.05, -0.1, -0.4}}};
  plan["coordinate_system"] = system == CoordinateSystem::kRas ? "RAS" : "LPS";
  return plan;
}

absl::StatusOr<PlanProblem> Resolve(const Json& json, TetMesh mesh,
                                    const ResolveOptions& options = {}) {
  absl::StatusOr<Plan> plan = Parse(json);
  if (!plan.ok()) return plan.status();
  return ResolvePlan(*plan, {.mesh = std::move(mesh), .point_data = {}, .cell_data = {}}, options);
}

absl::StatusOr<PlanProblem> Resolve(const Json& json, const ResolveOptions& options = {}) {
  return Resolve(json, PartedBlock().mesh, options);
}

auto IsRefused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr(why), Not(HasSubstr("\n"))));
}

Positions Solve(const PlanProblem& problem) {
  const auto deformer =
      CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer);
  EXPECT_THAT(deformer, IsOk());
  return (*deformer)->Deform(problem.poses)->positions;
}

TEST(PlannedContactTest, RowsComeBackFromTheTextToTheLastBit) {
  RandomNumbers random(7);
  const PartedBlock block;
  for (int run = 0; run < 50; ++run) {
    std::vector<ContactRow> rows = block.rows;
    for (ContactRow& row : rows) {
      row.normal = random.Vector().normalized();
      if (!row.bilateral) row.gap_mm = std::max(0.0, random.Next());
    }
    for (const CoordinateSystem system : {CoordinateSystem::kLps, CoordinateSystem::kRas}) {
      ASSERT_OK_AND_ASSIGN(const Plan plan, Parse(PlanOfBlock(rows, system)));
      ASSERT_OK_AND_ASSIGN(const std::vector<ContactRow> back, ResolveContact(plan));
      EXPECT_EQ(back, rows);
      const auto once = ConstraintSet::Create(block.mesh, {0}, {{"top", {44}}}, back);
      ASSERT_THAT(once, IsOk());
      const auto twice = ConstraintSet::Create(block.mesh, {0}, {{"top", {44}}}, once->contact());
      EXPECT_EQ(once->contact(), twice->contact()) << "normals are normalized once";
    }
  }
}

TEST(PlannedContactTest, VerticesWithRowsAreFreeWhereRegionsSelectThem) {
  const PartedBlock block;
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, Resolve(PlanOfBlock(block.rows)));
  EXPECT_EQ(problem.contact_use, ContactUse::kOn);
  EXPECT_THAT(problem.constraints.fixed(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_EQ(problem.constraints.contact(), block.rows);
  EXPECT_THAT(problem.freed, ElementsAre(FreedVertex{9, ConstraintSet::kFixed},
                                         FreedVertex{12, ConstraintSet::kFixed},
                                         FreedVertex{15, ConstraintSet::kFixed}));
  const ConstraintSet sticking = StickingRegions(problem);
  EXPECT_EQ(sticking.fixed(), PartedBlock::Fixed());
  EXPECT_EQ(sticking.handles()[0].vertices, PartedBlock::Top());
  EXPECT_THAT(sticking.contact(), IsEmpty());
  const auto same =
      CreateDeformer(*problem.mesh, problem.stiffness, block.Constraints(), problem.deformer);
  ASSERT_THAT(same, IsOk());
  EXPECT_EQ(Solve(problem), (*same)->Deform(problem.poses)->positions);
}

TEST(PlannedContactTest, WithoutRowsAPlanSticksAsBefore) {
  for (const bool contact : {true, false}) {
    ASSERT_OK_AND_ASSIGN(const PlanProblem problem, Resolve(PlanOfBlock({}), {.contact = contact}));
    EXPECT_EQ(problem.contact_use, ContactUse::kNone);
    EXPECT_THAT(problem.constraints.contact(), IsEmpty());
    EXPECT_THAT(problem.freed, IsEmpty());
    EXPECT_THAT(problem.constraints.fixed(), SizeIs(12));
    EXPECT_EQ(problem.mesh->num_vertices(), PartedBlock().mesh.num_vertices());
  }
}

TEST(PlannedContactTest, OffIsTheAnswerOfTheBlockThatWasNeverParted) {
  const PartedBlock block;
  for (const CoordinateSystem system : {CoordinateSystem::kLps, CoordinateSystem::kRas}) {
    ASSERT_OK_AND_ASSIGN(const PlanProblem off,
                         Resolve(PlanOfBlock(block.rows, system), {.contact = false}));
    EXPECT_EQ(off.contact_use, ContactUse::kLeftOut);
    EXPECT_THAT(off.freed, IsEmpty());
    ASSERT_OK_AND_ASSIGN(const PlanProblem whole,
                         Resolve(PlanOfBlock({}, system), PartedBlock::Whole()));
    EXPECT_EQ(off.mesh->positions(), whole.mesh->positions());
    EXPECT_EQ(off.mesh->tets(), whole.mesh->tets());
    EXPECT_EQ(off.constraints.constrained(), whole.constraints.constrained());
    EXPECT_EQ(Solve(off), Solve(whole));
  }
}

TEST(PlannedContactTest, OffSaysWhyLipsCannotBeJoined) {
  const PartedBlock block;
  Positions positions = block.mesh.positions();
  positions.row(0).swap(positions.row(positions.rows() - 1));
  TetIndices tets = block.mesh.tets();
  const auto last = static_cast<int32_t>(positions.rows()) - 1;
  for (int32_t& corner : tets.reshaped()) {
    if (corner == 0 || corner == last) corner = last - corner;
  }
  std::vector<ContactRow> rows = block.rows;
  rows.back().vertex = 0;
  Json plan = PlanOfBlock(rows);
  plan["fixed"] = {{"vertices", {1, 2, 3, 4, last}}};
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, tets));
  EXPECT_THAT(Resolve(plan, mesh), IsOk());
  EXPECT_THAT(Resolve(plan, mesh, {.contact = false}),
              IsRefused("without contact: the lips cannot be joined: vertex "));
}

// The digest is that of the file, also where the lips are joined afterwards.
TEST(PlannedContactTest, TheDigestIsThatOfThePartedMesh) {
  const PartedBlock block;
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "planned_contact_test";
  std::filesystem::create_directories(folder);
  ASSERT_THAT(WriteTetMesh((folder / "mesh.vtu").string(),
                           {.mesh = block.mesh, .point_data = {}, .cell_data = {}}),
              IsOk());
  Json json = PlanOfBlock(block.rows);
  json["mesh_sha256"] = ViewMeshPayload(block.mesh.positions(), block.mesh.tets(), {}).Sha256();
  ASSERT_OK_AND_ASSIGN(const Plan plan, Parse(json, folder.string()));
  EXPECT_THAT(ResolvePlan(plan), IsOk());
  EXPECT_THAT(ResolvePlan(plan, {.contact = false}), IsOk());
  std::filesystem::remove_all(folder);
}

TEST(PlannedContactTest, RowsNeedVersionFour) {
  Json plan = PlanOfBlock(PartedBlock().rows);
  EXPECT_EQ(LowestPlanVersion(plan), 4);
  plan["version"] = 3;
  EXPECT_THAT(Parse(plan), IsRefused("key \"contact\" at / came with version 4 of the format"));
}

TEST(PlannedContactTest, BadRowsAreNamed) {
  const Json good = {{"vertex", 20}, {"fixed", true}, {"normal", {0, 1, 0}}};
  const auto with = [&good](const Json& changes) {
    Json row = good;
    for (const auto& [key, value] : changes.items()) {
      if (value.is_null()) {
        row.erase(key);
      } else {
        row[key] = value;
      }
    }
    Json plan = PlanOfBlock(PartedBlock().rows);
    plan["contact"]["rows"] = Json::array({row});
    return Resolve(plan);
  };
  EXPECT_THAT(with(Json::object()), IsOk());
  const struct {
    Json changes;
    std::string why;
  } cases[] = {
      {{{"fixed", nullptr}}, "/contact/rows/0"},
      {{{"fixed", false}}, "/contact/rows/0/fixed"},
      {{{"handle", "top"}}, "/contact/rows/0"},
      {{{"other_vertex", 3}}, "/contact/rows/0"},
      {{{"fixed", nullptr}, {"handle", "chin"}},
       "contact row 0 names handle \"chin\"; the plan has no handle of that name"},
      {{{"vertex", -1}}, "/contact/rows/0/vertex: -1"},
      {{{"vertex", 2.5}}, "/contact/rows/0/vertex"},
      {{{"vertex", 5000}}, "contact row 0 names vertex 5000"},
      {{{"vertex", 4294967296}}, "/contact/rows/0/vertex"},
      {{{"fixed", nullptr}, {"other_vertex", 5000}}, "contact row 0 names vertex 5000"},
      {{{"fixed", nullptr}, {"other_vertex", 20}}, "contact row 0 lets vertex 20 touch itself"},
      {{{"normal", {0, 2, 0}}}, "contact row 0 has a normal of length 2"},
      {{{"normal", {0, 0, 0}}}, "contact row 0 has a normal of length 0"},
      {{{"normal", {0, 1}}}, "/contact/rows/0/normal"},
      {{{"normal", nullptr}}, "missing key \"normal\""},
      {{{"gap_mm", -0.1}}, "/contact/rows/0/gap_mm: -0.1"},
      {{{"gap_mm", 0.1}, {"bilateral", true}}, "contact row 0 is bilateral with a gap"},
      {{{"bilateral", 1}}, "/contact/rows/0/bilateral"},
      {{{"friction", 0.1}}, "unknown key \"friction\""},
  };
  for (const auto& bad : cases) EXPECT_THAT(with(bad.changes), IsRefused(bad.why)) << bad.changes;
}

TEST(PlannedContactTest, NotNumbersAndTooManyRowsAreRefused) {
  std::string text = PlanOfBlock(PartedBlock().rows).dump();
  text.replace(text.find("0.125"), 5, "NaN");
  EXPECT_THAT(ParsePlan(text, "", "plan.json"), IsRefused("plan plan.json"));
  Json plan = PlanOfBlock(PartedBlock().rows);
  const Json row = plan["contact"]["rows"][0];
  plan["contact"]["rows"] = Json::array();
  EXPECT_THAT(Parse(plan), IsRefused("/contact/rows"));
  while (plan["contact"]["rows"].size() <= kMaxContactRows) plan["contact"]["rows"].push_back(row);
  EXPECT_THAT(Parse(plan), IsRefused("/contact/rows"));
}

Json PlanWithSeal(CoordinateSystem system = CoordinateSystem::kLps) {
  const PartedBlock block;
  Json plan = PlanOfBlock(block.rows, system);
  plan["contact"]["seal"] = LipEdgeToJson(block.Edge(), system);
  return plan;
}

TEST(PlannedContactTest, TheLipsEdgeComesBackAndIsForContactOnly) {
  LipEdge edge = PartedBlock().Edge();
  ASSERT_THAT(edge.pairs, SizeIs(3));
  for (const CoordinateSystem system : {CoordinateSystem::kLps, CoordinateSystem::kRas}) {
    edge.up = Eigen::Vector3d(1, -2, 3).normalized();
    Json plan = PlanWithSeal(system);
    plan["contact"]["seal"] = LipEdgeToJson(edge, system);
    EXPECT_EQ(LowestPlanVersion(plan), 4);
    ASSERT_OK_AND_ASSIGN(const PlanProblem problem, Resolve(plan));
    EXPECT_EQ(problem.lip_edge, edge);
    ASSERT_OK_AND_ASSIGN(const PlanProblem off, Resolve(plan, {.contact = false}));
    EXPECT_EQ(off.lip_edge, std::nullopt);
  }
  ASSERT_OK_AND_ASSIGN(const PlanProblem without, Resolve(PlanOfBlock(PartedBlock().rows)));
  EXPECT_EQ(without.lip_edge, std::nullopt);
}

TEST(PlannedContactTest, BadEdgesAreNamed) {
  const auto [upper, lower] = PartedBlock().Edge().pairs[0];
  const Json good = {upper, lower};
  const struct {
    const char* key;
    Json value;
    std::string why;
  } cases[] = {
      {"up", {0, 0, 2}, "contact seal: \"up\" has length 2; it must be 1"},
      {"up", {0, 0, 0}, "contact seal: \"up\" has length 0"},
      {"up", {0, 1}, "/contact/seal/up"},
      {"pairs", Json::array(), "/contact/seal/pairs"},
      {"pairs", {{upper}}, "/contact/seal/pairs/0"},
      {"pairs", {{upper, -1}}, "/contact/seal/pairs/0/1: -1"},
      {"pairs", {good, {5000, 3}}, "contact seal: pair 1 names vertex 5000, but the mesh has"},
      {"pairs", {good, good}, "contact seal: pair 1 names vertex"},
      {"pairs", {{upper, upper}}, "again; a vertex belongs to one pair"},
      {"pairs", {{upper, 20}}, "of pair 0 are not at one place at rest; remove the pair"},
      {"strength", 3, "unknown key \"strength\""},
  };
  for (const auto& bad : cases) {
    Json plan = PlanWithSeal();
    plan["contact"]["seal"][bad.key] = bad.value;
    EXPECT_THAT(Resolve(plan), IsRefused(bad.why)) << bad.value;
  }
  Json plan = PlanWithSeal();
  plan["contact"].erase("rows");
  EXPECT_THAT(Resolve(plan), IsRefused("missing key \"rows\""));
  plan = PlanWithSeal();
  std::erase_if(
      plan["contact"]["rows"].get_ref<Json::array_t&>(),
      [lower = lower](const Json& row) { return row.value("other_vertex", -1) == lower; });
  EXPECT_THAT(Resolve(plan), IsRefused("pair 0 has no contact row between its vertices; add it"));
}

TEST(PlannedContactTest, ARegionKeepsAVertexWithoutRows) {
  Json plan = PlanOfBlock(PartedBlock().rows);
  plan["fixed"] = {{"vertices", PartedBlock::kSliding}};
  EXPECT_THAT(Resolve(plan), IsRefused("fixed: every selected vertex has contact rows"));
  EXPECT_THAT(Resolve(plan, {.contact = false}), IsOk());
}

}  // namespace
}  // namespace tissueform
