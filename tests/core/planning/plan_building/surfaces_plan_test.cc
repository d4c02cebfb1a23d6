// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/skin_region.h"
#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_building/solid_voxels.h"
#include "core/planning/plan_building/surfaces_file.h"
#include "core/planning/plan_io.h"
#include "core/planning/plan_report/plan_report.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/core/planning/plan_building/exported_head.h"
#include "tests/core/planning/plan_building/plan_comparison.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ContainsRegex;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

// A folder with the surfaces of the phantom of a head and a file that names them.
class SurfacesPlanTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    absl::StatusOr<ExportedHead> exported = ExportHead(HeadPhantom(), HeadPhantomParts(), 12);
    ASSERT_THAT(exported.status(), IsOk());
    phantom = new ExportedHead(*std::move(exported));
  }
  static void TearDownTestSuite() {
    delete phantom;
    phantom = nullptr;
  }

  void SetUp() override {
    folder_ = ::testing::TempDir() + "/surfaces_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
    ASSERT_THAT(WriteHead(*phantom, folder_), IsOk());
    json_ = {
        {"format", "tissueform-surfaces"},
        {"version", 1},
        {"units", "mm"},
        {"coordinate_system", "LPS"},
        {"skin", {{"file", "skin.stl"}}},
        {"skull", {{"file", "skull.stl"}}},
        {"lower_jaw", {{"file", "lower_jaw.stl"}}},
        {"segments",
         {{{"name", "jaw"}, {"surface", "lower_jaw"}, {"pose", {{"translation_mm", {0, 5, 0}}}}}}},
        {"spacing_mm", 2.5},
        {"mesh", {{"edge_mm", 6.5}, {"fine_edge_mm", 5}}}};
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write() const {
    std::ofstream(folder_ + "/surfaces.json") << json_.dump();
    return folder_ + "/surfaces.json";
  }
  void WriteSurface(const std::string& name, const TriangleMesh& mesh) const {
    ASSERT_THAT(
        WriteTriangleMesh(folder_ + "/" + name, {.mesh = mesh, .point_data = {}, .cell_data = {}}),
        IsOk());
  }
  void TransformAll(const Eigen::Matrix3d& linear) const {
    ASSERT_THAT(WriteHead({Transformed(phantom->skin, linear), Transformed(phantom->skull, linear),
                           Transformed(phantom->lower_jaw, linear)},
                          folder_),
                IsOk());
  }
  absl::StatusOr<PlanBuild> Build() const {
    return BuildPlanFromSurfaces(Write(), {.threads = 2, .on_stage = {}});
  }
  std::string Refusal() const {
    const absl::StatusOr<PlanBuild> build = Build();
    EXPECT_FALSE(build.ok());
    const std::string message(build.status().message());
    EXPECT_EQ(message.find('\n'), std::string::npos);
    return message;
  }

  static ExportedHead* phantom;
  std::string folder_;
  Json json_;
};
ExportedHead* SurfacesPlanTest::phantom = nullptr;

// Of the skin in a region, in mm.
double MeanBackward(const PlanBuild& build, const Positions& moved, SkinRegion region) {
  double sum_mm = 0;
  int64_t count = 0;
  for (size_t v = 0; v < build.regions.on_skin.size(); ++v) {
    const bool is_in = build.regions.skin_region[v] == static_cast<uint8_t>(region);
    if (!is_in || !build.regions.on_skin[v]) continue;
    sum_mm += moved(static_cast<Eigen::Index>(v), 1);
    ++count;
  }
  return sum_mm / static_cast<double>(count);
}

TEST_F(SurfacesPlanTest, PhantomBecomesAPlanWhoseSkinFollowsTheJaw) {
  absl::StatusOr<PlanBuild> build = Build();
  ASSERT_THAT(build.status(), IsOk());
  EXPECT_GT(build->mesh.mesh.num_tets(), 3000);
  ASSERT_EQ(build->segments.size(), 1);
  EXPECT_TRUE(build->segments[0].cut.planes.empty());
  EXPECT_DOUBLE_EQ(build->segments[0].largest_move_mm, 5);
  EXPECT_EQ(build->num_inverted, 0);
  EXPECT_THAT(build->stiffness.youngs_modulus_pa, Each(15000));
  EXPECT_LT(build->skin_distance.mean_mm, 0.2);
  EXPECT_THAT(build->ct.notes, Contains(HasSubstr("The skin is open")));
  ASSERT_THAT(WritePlan(*build, folder_), IsOk());
  EXPECT_THAT(ReadPlan(folder_ + "/plan.json").status(), IsOk());

  absl::StatusOr<PlanProblem> problem = ToPlanProblem(*build);
  ASSERT_THAT(problem.status(), IsOk());
  problem->deformer.model = DeformationModel::kLinearElastic;
  const auto deformer =
      CreateDeformer(*problem->mesh, problem->stiffness, problem->constraints, problem->deformer);
  ASSERT_THAT(deformer.status(), IsOk());
  const absl::StatusOr<Deformation> answer = (*deformer)->Deform(problem->poses);
  ASSERT_THAT(answer.status(), IsOk());
  const Positions moved = answer->positions - problem->mesh->positions();
  EXPECT_GT(MeanBackward(*build, moved, SkinRegion::kChin), 3.5);
  EXPECT_LT(MeanBackward(*build, moved, SkinRegion::kNose), 0.5);
}

// A file of that folder, without what may name a CT: notes, which say that no CT was given.
std::string WithoutNotes(const std::string& path, const PlanBuild& build) {
  std::string text = BytesOfFile(path);
  for (const std::string& note : build.ct.notes) {
    text = absl::StrReplaceAll(text, {{note, ""}});
  }
  return text;
}

TEST_F(SurfacesPlanTest, TheReportNamesSurfacesAndNoCt) {
  std::filesystem::rename(folder_ + "/skin.stl", folder_ + "/Smith.stl");
  json_["skin"]["file"] = "Smith.stl";
  const absl::StatusOr<PlanBuild> build = Build();
  ASSERT_THAT(build.status(), IsOk());
  ASSERT_THAT(
      WritePlanReport(*build, {.program_version = "1", .pictures = false, .on_stage = {}}, folder_),
      IsOk());
  for (const char* const name : {"/report.json", "/report.html"}) {
    EXPECT_THAT(WithoutNotes(folder_ + name, *build),
                AllOf(Not(ContainsRegex("[^A-Z]CT[^A-Z]")), Not(HasSubstr("Smith"))))
        << name;
  }
  const Json report = Json::parse(BytesOfFile(folder_ + "/report.json"));
  EXPECT_EQ(report["input"]["format"], "surfaces");
  EXPECT_EQ(report["input"]["surfaces"], (Json{"skin", "skull", "lower jaw"}));
  EXPECT_FALSE(report["input"].contains("ct_sha256"));
  EXPECT_EQ(report["metal"]["looked_for"], false);
  EXPECT_THAT(BytesOfFile(folder_ + "/report.html"),
              HasSubstr("Made from surfaces (skin, skull, lower jaw) by tissueform 1."));
}

TEST_F(SurfacesPlanTest, UnitsAndAxesDoNotChangeThePlan) {
  const absl::StatusOr<PlanBuild> plain = Build();
  ASSERT_THAT(plain.status(), IsOk());
  // In RAS and in centimeters, from one file that says nothing of it.
  TransformAll(Eigen::Vector3d(-0.1, -0.1, 0.1).asDiagonal());
  json_["units"] = "cm";
  json_["coordinate_system"] = "RAS";
  const absl::StatusOr<PlanBuild> turned = Build();
  ASSERT_THAT(turned.status(), IsOk());
  const Eigen::Vector3d chin = plain->landmarks.skin_pogonion;
  EXPECT_LT((turned->landmarks.skin_pogonion - chin).norm(), 0.3);
  EXPECT_NEAR(turned->soft_tissue.volume_mm3 / plain->soft_tissue.volume_mm3, 1, 0.003);
  json_.erase("units");
  json_["scale"] = 10;
  json_.erase("coordinate_system");
  EXPECT_THAT(Refusal(), HasSubstr("\"RAS\""));
}

TEST_F(SurfacesPlanTest, AssumptionsAreStated) {
  json_.erase("units");
  json_.erase("coordinate_system");
  const absl::StatusOr<SurfacesInput> input = ReadSurfaces(Write(), 1);
  ASSERT_THAT(input.status(), IsOk());
  EXPECT_THAT(input->provenance.notes,
              AllOf(Contains(HasSubstr("mm are assumed")), Contains(HasSubstr("LPS is assumed"))));
}

TEST_F(SurfacesPlanTest, DamagedSurfacesGiveNearlyTheSamePlan) {
  const absl::StatusOr<PlanBuild> plain = Build();
  ASSERT_THAT(plain.status(), IsOk());
  const auto without_some = [](const TriangleMesh& mesh) {
    TriangleIndices kept(mesh.num_triangles() - (mesh.num_triangles() + 96) / 97, 3);
    Eigen::Index row = 0;
    for (Eigen::Index f = 0; f < mesh.num_triangles(); ++f) {
      if (f % 97 != 0) kept.row(row++) = mesh.triangles().row(f);
    }
    return *TriangleMesh::Create(mesh.positions(), kept);
  };
  ASSERT_THAT(WriteHead({without_some(phantom->skin), without_some(phantom->skull),
                         without_some(phantom->lower_jaw)},
                        folder_),
              IsOk());
  const absl::StatusOr<PlanBuild> damaged = Build();
  ASSERT_THAT(damaged.status(), IsOk());
  EXPECT_NEAR(damaged->soft_tissue.volume_mm3 / plain->soft_tissue.volume_mm3, 1, 0.003);
  EXPECT_NEAR(damaged->segments[0].volume_mm3 / plain->segments[0].volume_mm3, 1, 0.01);
}

// What an image leaves of a head that it does not hold whole: open behind, above and below, in one
// border that no plane holds.
TEST_F(SurfacesPlanTest, HeadCutByABoxGivesNearlyTheSameFace) {
  const absl::StatusOr<PlanBuild> plain = Build();
  ASSERT_THAT(plain.status(), IsOk());
  const auto in_box = [](const TriangleMesh& mesh) {
    std::vector<Eigen::RowVector3i> kept;
    for (const auto& t : mesh.triangles().rowwise()) {
      const Eigen::RowVector3d corner = mesh.positions().row(t[0]);
      if (corner.y() < 45 && corner.z() < 55) kept.emplace_back(t);
    }
    TriangleIndices triangles(static_cast<Eigen::Index>(kept.size()), 3);
    for (size_t f = 0; f < kept.size(); ++f) triangles.row(static_cast<Eigen::Index>(f)) = kept[f];
    return *TriangleMesh::Create(mesh.positions(), triangles);
  };
  ASSERT_THAT(
      WriteHead({in_box(phantom->skin), in_box(phantom->skull), phantom->lower_jaw}, folder_),
      IsOk());
  const absl::StatusOr<PlanBuild> cut = Build();
  ASSERT_THAT(cut.status(), IsOk());
  const Eigen::Vector3d chin = plain->landmarks.skin_pogonion;
  EXPECT_LT((cut->landmarks.skin_pogonion - chin).norm(), 0.5);
  EXPECT_NEAR(cut->soft_tissue.volume_mm3 / plain->soft_tissue.volume_mm3, 1, 0.05);
}

// Skins without airway and sinuses, and a skull with a wide hole in its base: brain and face are
// one piece of tissue, as deep in the face as in the brain.
TEST_F(SurfacesPlanTest, SolidHeadKeepsItsFaceAndLosesItsBrain) {
  const absl::StatusOr<PlanBuild> plain = Build();
  ASSERT_THAT(plain.status(), IsOk());
  LabelGrid parts = HeadPhantomParts();
  ForEachVoxel(parts, [&](size_t index, const Eigen::Vector3d& place) {
    const bool in_base =
        std::abs(place.x()) < 25 && std::abs(place.z()) < 16 && place.y() > -60 && place.y() < 30;
    if (in_base && parts.values[index] == kCranium) parts.values[index] = 0;
  });
  const LabelGrid solid = HeadPhantomMask();
  HuGrid hu(solid.geometry, -1000);
  ForEachVoxel(solid, [&](size_t index, const Eigen::Vector3d&) { hu.values[index] = 0; });
  const absl::StatusOr<ExportedHead> head = ExportHead(hu, parts, 12);
  ASSERT_THAT(head.status(), IsOk());
  ASSERT_THAT(WriteHead(*phantom, folder_), IsOk());
  json_["skin"]["wrap_mm"] = 2;  // also fills what is left of cavities
  const absl::StatusOr<PlanBuild> build = Build();
  ASSERT_THAT(build.status(), IsOk());
  EXPECT_NEAR(build->soft_tissue.volume_mm3 / plain->soft_tissue.volume_mm3, 0.95, 0.12);
  EXPECT_GT(build->soft_tissue.left_out_mm3, 10e3);
}

TEST_F(SurfacesPlanTest, TissueInsideASurfaceHasItsOwnStiffness) {
  // A box over the whole face in front of the chin's bone, and all below the palate.
  TriangleMesh box = Transformed(
      *TriangleMesh::Create((Positions(8, 3) << 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 0, 1, 1, 0,
                             1, 0, 1, 1, 1, 1, 1)
                                .finished(),
                            (TriangleIndices(12, 3) << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4,
                             1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5)
                                .finished()),
      Eigen::Vector3d(200, 80, 100).asDiagonal());
  box = *TriangleMesh::Create(box.positions().rowwise() + Eigen::RowVector3d(-100, -120, -140),
                              box.triangles());
  WriteSurface("fat.ply", box);
  json_["young_modulus_kpa"] = 20;
  json_["tissues"] = {
      {{"name", "fat"}, {"surface", {{"file", "fat.ply"}}}, {"young_modulus_kpa", 5}}};
  const absl::StatusOr<PlanBuild> build = Build();
  ASSERT_THAT(build.status(), IsOk());
  double in_box = 0;
  double behind = 0;
  int64_t num_in_box = 0;
  int64_t num_behind = 0;
  const TetMesh& mesh = build->mesh.mesh;
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    Eigen::RowVector3d center = Eigen::RowVector3d::Zero();
    for (const int32_t v : mesh.tets().row(t)) center += mesh.positions().row(v) / 4;
    const double modulus = build->stiffness.youngs_modulus_pa[static_cast<size_t>(t)];
    if (center.y() < -50 && center.z() < -50) {
      in_box += modulus;
      ++num_in_box;
    }
    if (center.y() > -30) {
      behind += modulus;
      ++num_behind;
    }
  }
  ASSERT_GT(num_in_box, 50);
  ASSERT_GT(num_behind, 50);
  EXPECT_LT(in_box / static_cast<double>(num_in_box), 12000);
  EXPECT_NEAR(behind / static_cast<double>(num_behind), 20000, 1);
}

TEST_F(SurfacesPlanTest, MovementComesFromATransformOrAMovedSurface) {
  Json& segment = json_["segments"][0];
  segment.erase("pose");
  std::ofstream(folder_ + "/jaw.tfm") << "#Insight Transform File V1.0\n#Transform 0\n"
                                         "Transform: TranslationTransform_double_3_3\n"
                                         "Parameters: 0 -5 1\nFixedParameters:\n";
  segment["transform"] = "jaw.tfm";
  const absl::StatusOr<SurfacesInput> by_file = ReadSurfaces(Write(), 1);
  ASSERT_THAT(by_file.status(), IsOk());
  EXPECT_EQ(by_file->recipe.segments[0].pose.translation_mm, Eigen::Vector3d(0, 5, -1));
  EXPECT_THAT(by_file->provenance.notes, Contains(HasSubstr("moves 5.0 mm backward, 1.0 mm down")));

  segment.erase("transform");
  segment["moved"]["file"] = "after.stl";
  Positions after = phantom->lower_jaw.positions();
  after.rowwise() += Eigen::RowVector3d(1, 6, 0);
  WriteSurface("after.stl", *TriangleMesh::Create(after, phantom->lower_jaw.triangles()));
  const absl::StatusOr<SurfacesInput> by_fit = ReadSurfaces(Write(), 1);
  ASSERT_THAT(by_fit.status(), IsOk());
  EXPECT_LT((by_fit->recipe.segments[0].pose.translation_mm - Eigen::Vector3d(1, 6, 0)).norm(),
            1e-3);
  EXPECT_THAT(by_fit->provenance.notes, Contains(HasSubstr("mm RMS")));

  segment["moved"]["file"] = "skull.stl";
  EXPECT_THAT(Refusal(), HasSubstr("not the same piece"));
  segment["transform"] = "jaw.tfm";
  EXPECT_THAT(Refusal(), HasSubstr("exclude each other"));
}

struct BadSurfaces {
  const char* name;
  std::function<void(Json*)> change;
  const char* said;
};

TEST_F(SurfacesPlanTest, RefusesInvalidSurfacesFiles) {
  const std::vector<BadSurfaces> cases = {
      {"no jaw", [](Json* j) { j->erase("lower_jaw"); }, "lower_jaw"},
      {"both", [](Json* j) { (*j)["scale"] = 2; }, "exclude each other"},
      {"axes", [](Json* j) { (*j)["coordinate_system"] = "ASL"; }, "coordinate_system"},
      {"unit", [](Json* j) { (*j)["units"] = "inch"; }, "units"},
      {"no file", [](Json* j) { (*j)["skin"]["file"] = "none.stl"; }, "skin"},
      {"segment", [](Json* j) { (*j)["segments"][0].erase("surface"); }, "no \"surface\""},
      {"mixed",
       [](Json* j) {
         (*j)["segments"].push_back({{"name", "b"}, {"osteotomy", "bssro"}});
       },
       "give all as surfaces"},
      {"far",
       [](Json* j) {
         (*j)["segments"][0]["pose"]["translation_mm"] = {0, 80, 0};
       },
       "80"},
      {"twice", [](Json* j) { (*j)["segments"].push_back((*j)["segments"][0]); }, "two segments"},
      {"in m", [](Json* j) { (*j)["units"] = "m"; }, "the skin is"},
      {"inside out", [](Json* j) { (*j)["skin"]["flip"] = true; }, "the skin is inside out"},
      {"bone inside out", [](Json* j) { (*j)["skull"]["flip"] = true; }, "the skull is inside out"},
      {"exchanged", [](Json* j) { std::swap((*j)["skull"], (*j)["lower_jaw"]); }, "exchanged"},
      {"one bone twice", [](Json* j) { (*j)["skull"] = (*j)["lower_jaw"]; }, "overlaps"},
      {"skin is bone", [](Json* j) { (*j)["skin"] = (*j)["skull"]; }, "outside the skin"}};
  const Json good = json_;
  for (const BadSurfaces& bad : cases) {
    SCOPED_TRACE(bad.name);
    json_ = good;
    bad.change(&json_);
    EXPECT_THAT(Refusal(), HasSubstr(bad.said));
  }
}

TEST_F(SurfacesPlanTest, RefusesImplausibleCoordinates) {
  TransformAll(Eigen::Vector3d(0.001, 0.001, 0.001).asDiagonal());
  EXPECT_THAT(Refusal(), HasSubstr("\"units\": \"m\""));
  TransformAll(Eigen::Vector3d(-1, -1, 1).asDiagonal());
  EXPECT_THAT(Refusal(), HasSubstr("\"RAS\""));
  TransformAll(Eigen::Vector3d(-1, 1, 1).asDiagonal());
  EXPECT_THAT(Refusal(), HasSubstr("mirrored"));
  TransformAll(Eigen::Vector3d(1, -1, -1).asDiagonal());
  EXPECT_THAT(Refusal(), HasSubstr("above the skull"));

  TransformAll(Eigen::Matrix3d::Identity());
  WriteSurface("skull.stl", *TriangleMesh::Create(
                                phantom->skull.positions().rowwise() + Eigen::RowVector3d(0, 90, 0),
                                phantom->skull.triangles()));
  EXPECT_THAT(Refusal(), HasSubstr("outside the skin"));
}

// Two ways to one plan: from a CT, and from the surfaces of skin and bones of that CT alone.
TEST(SurfacesOfBundledHeadTest, PredictsTheSameAsThePlanOfTheCt) {
  Recipe recipe;
  recipe.ct.hu_offset = -1024;
  recipe.ct.axes = "RPI";
  recipe.spacing_mm = 2;
  recipe.tissues = {{.name = "soft_tissue",
                     .hu_below = std::numeric_limits<double>::infinity(),
                     .youngs_modulus_pa = 15000,
                     .source = "test"}};
  RecipeSegment mandible;
  mandible.name = "mandible";
  mandible.pose.translation_mm.y() = 6;
  recipe.segments = {mandible};
  const absl::StatusOr<PlanBuild> ct = BuildPlan(TestDataPath("ct/headsq/headsq_quarter.nhdr"),
                                                 recipe, {.threads = 2, .on_stage = {}});
  ASSERT_THAT(ct.status(), IsOk());
  const std::string folder = ::testing::TempDir() + "/surfaces_of_bundled_head";
  std::filesystem::create_directories(folder);
  const absl::StatusOr<ExportedHead> head = ExportHead(ct->head.hu, ct->parts.labels, 4);
  ASSERT_THAT(head.status(), IsOk());
  ASSERT_THAT(WriteHead(*head, folder), IsOk());
  std::ofstream(folder + "/surfaces.json") << Json{{"format", "tissueform-surfaces"},
                                                   {"version", 1},
                                                   {"units", "mm"},
                                                   {"coordinate_system", "LPS"},
                                                   {"skin", {{"file", "skin.stl"}}},
                                                   {"skull", {{"file", "skull.stl"}}},
                                                   {"lower_jaw", {{"file", "lower_jaw.stl"}}},
                                                   {"spacing_mm", 2},
                                                   {"segments",
                                                    {{{"name", "mandible"},
                                                      {"osteotomy", "bssro"},
                                                      {"pose", {{"translation_mm", {0, 6, 0}}}}}}}}
                                                  .dump();
  const absl::StatusOr<PlanBuild> surfaces =
      BuildPlanFromSurfaces(folder + "/surfaces.json", {.threads = 2, .on_stage = {}});
  ASSERT_THAT(surfaces.status(), IsOk());
  const absl::StatusOr<PlanDifference> difference =
      ComparePlans(*surfaces, *ct, DeformationModel::kLinearElastic);
  ASSERT_THAT(difference.status(), IsOk());
  EXPECT_LT(difference->movement_mean_mm, 0.3);
  EXPECT_LT(difference->landmark.mm, 4) << difference->landmark.name;
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace tissueform::testing
