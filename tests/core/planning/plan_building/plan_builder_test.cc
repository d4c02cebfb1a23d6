// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_builder.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string_view>
#include <tuple>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/validation.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_building/viewer_surfaces.h"
#include "core/planning/plan_io.h"
#include "core/planning/skin_places.h"
#include "tests/core/planning/plan_building/coarse_recipe.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;
using testing::TestDataPath;

// Quick: the bundled head on coarse voxels with coarse tets.
Recipe CoarseRecipe() {
  Recipe recipe = testing::CoarseRecipe();
  recipe.ct.hu_offset = -1024;
  recipe.ct.axes = "RPI";
  return recipe;
}

std::string BundledCt() { return TestDataPath("ct/headsq/headsq_quarter.nhdr"); }

// Whole, inside each other, and moving with the right bone.
void ExpectSurfacesOfAHead(const ViewerFile& viewer) {
  ASSERT_GE(viewer.surfaces.size(), 5U);
  const CaseSurface& skin = viewer.surfaces[0];
  EXPECT_EQ(skin.kind, SurfaceKind::kSkin);
  const Eigen::RowVector3f low = skin.positions.colwise().minCoeff();
  const Eigen::RowVector3f high = skin.positions.colwise().maxCoeff();
  Eigen::Index triangles = 0;
  int teeth = 0;
  int segments = 0;
  for (const CaseSurface& surface : viewer.surfaces) {
    triangles += surface.triangles.rows();
    teeth += surface.kind == SurfaceKind::kTeeth ? 1 : 0;
    segments += surface.kind == SurfaceKind::kSegment ? 1 : 0;
    if (surface.kind == SurfaceKind::kSkin) continue;
    EXPECT_TRUE((surface.positions.colwise().minCoeff().array() > low.array()).all());
    EXPECT_TRUE((surface.positions.colwise().maxCoeff().array() < high.array()).all());
  }
  EXPECT_EQ(teeth, 2);  // the upper ones of the skull, the lower ones of the jaw
  EXPECT_EQ(segments, 1);
  EXPECT_LE(triangles, kSkinTriangles + kBoneTriangles + 5000);
  const auto find = [&](const std::string& name) {
    return std::find_if(viewer.landmarks.begin(), viewer.landmarks.end(),
                        [&](const CaseLandmark& landmark) { return landmark.name == name; });
  };
  for (const char* name : {"pogonion", "lower_incisor", "menton"}) {
    ASSERT_NE(find(name), viewer.landmarks.end());
    EXPECT_EQ(find(name)->handle, "mandible") << name;
  }
  ASSERT_NE(find("upper_incisor"), viewer.landmarks.end());
  EXPECT_EQ(find("upper_incisor")->handle, "");
  for (const char* name : {"pronasale", "subnasale", "labrale_superius", "soft_pogonion"}) {
    const auto landmark = find(name);
    ASSERT_TRUE(landmark != viewer.landmarks.end() && landmark->skin_vertex.has_value()) << name;
    const Eigen::Vector3d vertex =
        skin.positions.row(*landmark->skin_vertex).cast<double>().transpose();
    EXPECT_LT((vertex - landmark->position_mm).norm(), 4) << name;
  }
}

TEST(PlanBuilderTest, BundledHeadBecomesAUsablePlan) {
  double last = 0;
  PlanBuildOptions options;
  options.threads = 2;
  options.on_stage = [&last](absl::string_view stage, double fraction) {
    EXPECT_FALSE(stage.empty());
    EXPECT_GE(fraction, last) << std::string(stage);
    last = fraction;
  };
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(BundledCt(), CoarseRecipe(), options));
  EXPECT_EQ(last, 1);
  const TetMesh& mesh = build.mesh.mesh;
  EXPECT_THAT(CheckTetMesh(mesh), IsOk());
  EXPECT_EQ(ValidateTetMesh(mesh).num_components, 1);
  EXPECT_LE(build.mesh.report.tets_below_3_deg, mesh.num_tets() / 1000);
  EXPECT_NEAR(build.mesh.report.volume_ratio, 1, 0.03);
  EXPECT_LE(build.skin_distance.mean_mm, 0.6 * 2.5);
  EXPECT_LE(build.skin_distance.p99_mm, 2 * 2.5);
  EXPECT_GT(build.skin_distance.mm.size(), 500U);
  EXPECT_EQ(build.stiffness.youngs_modulus_pa.size(), static_cast<size_t>(mesh.num_tets()));
  EXPECT_EQ(build.segments.size(), 1U);
  EXPECT_GT(build.segments[0].volume_mm3, 20e3);

  const std::string folder = ::testing::TempDir() + "plan_builder_test";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  ASSERT_THAT(WritePlan(build, folder), IsOk());
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(folder + "/plan.json"));
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, ResolvePlan(plan));
  EXPECT_EQ(problem.poses[0].translation_mm.y(), -6);
  for (const char* name : {"mean_hu", "voxels", "tissue", "youngs_modulus_pa"}) {
    EXPECT_NE(FindAttribute(problem.cell_data, name), nullptr) << name;
  }
  EXPECT_NE(FindAttribute(problem.point_data, "skin_region"), nullptr);
  EXPECT_TRUE(std::filesystem::is_regular_file(folder + "/segments/mandible.stl"));
  ASSERT_OK_AND_ASSIGN(const ViewerFile viewer, ReadViewer(folder + "/viewer.glb"));
  ASSERT_OK_AND_ASSIGN(const std::string mesh_sha256, MeshFileSha256(folder + "/head.vtu"));
  EXPECT_EQ(viewer.mesh_file_sha256, mesh_sha256);
  ExpectSurfacesOfAHead(viewer);
  std::filesystem::remove_all(folder);
}

void ExpectSameArrays(const std::vector<Attribute>& a, const std::vector<Attribute>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].components, b[i].components);
    EXPECT_EQ(a[i].values, b[i].values) << a[i].name;  // type and every bit
  }
}

// Upright, in the scanner's axes: 1.4 degrees of it, which do not matter here.
TEST(PlanBuilderTest, PlanesOfTheHeadFrameCanBeGiven) {
  Recipe recipe = CoarseRecipe();
  recipe.horizontal = Plane{{-97, 113, -33}, Eigen::Vector3d::UnitZ()};
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(BundledCt(), recipe));
  EXPECT_EQ(build.head_frame.source, "recipe");
  EXPECT_GT(build.head_frame.superior.z(), 0.999);
}

TEST(PlanBuilderTest, ProblemOfABuildEqualsThatOfItsFilesToTheLastBit) {
  Recipe recipe = CoarseRecipe();
  // An angle that does not come back from degrees to the last bit.
  recipe.segments[0].pose.rotation_vector = {0.1, -0.03, 0.007};
  recipe.segments[0].pose.pivot_mm = {1.0 / 3, 2.0 / 7, -40.1};
  recipe.segments[0].pose.scale = 1.01;
  recipe.poisson_ratio = 0.43;
  recipe.model = DeformationModel::kLinearElastic;
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(BundledCt(), recipe));
  ASSERT_OK_AND_ASSIGN(const PlanProblem direct, ToPlanProblem(build));

  const std::string folder = ::testing::TempDir() + "plan_problem_test";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  ASSERT_THAT(WritePlan(build, folder), IsOk());
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(folder + "/plan.json"));
  ASSERT_OK_AND_ASSIGN(const PlanProblem read, ResolvePlan(plan));
  std::filesystem::remove_all(folder);

  EXPECT_EQ(direct.mesh->positions(), read.mesh->positions());
  EXPECT_EQ(direct.mesh->tets(), read.mesh->tets());
  EXPECT_EQ(direct.stiffness, read.stiffness);
  EXPECT_EQ(direct.written_in, read.written_in);
  ExpectSameArrays(direct.point_data, read.point_data);
  ExpectSameArrays(direct.cell_data, read.cell_data);
  EXPECT_EQ(direct.constraints.fixed(), read.constraints.fixed());
  ASSERT_EQ(direct.constraints.handles().size(), 1U);
  ASSERT_EQ(read.constraints.handles().size(), 1U);
  EXPECT_EQ(direct.constraints.handles()[0].name, read.constraints.handles()[0].name);
  EXPECT_EQ(direct.constraints.handles()[0].vertices, read.constraints.handles()[0].vertices);
  ASSERT_EQ(direct.poses.size(), 1U);
  ASSERT_EQ(read.poses.size(), 1U);
  EXPECT_EQ(direct.poses[0].rotation_vector, read.poses[0].rotation_vector);
  EXPECT_EQ(direct.poses[0].pivot_mm, read.poses[0].pivot_mm);
  EXPECT_EQ(direct.poses[0].translation_mm, read.poses[0].translation_mm);
  EXPECT_EQ(direct.poses[0].scale, read.poses[0].scale);
  EXPECT_EQ(direct.deformer.model, read.deformer.model);
  EXPECT_EQ(direct.deformer.preparation.poisson_ratio, read.deformer.preparation.poisson_ratio);
  EXPECT_EQ(direct.deformer.gradient_field.rotation, read.deformer.gradient_field.rotation);
  EXPECT_EQ(direct.deformer.gradient_field.max_iterations,
            read.deformer.gradient_field.max_iterations);
}

TEST(PlanBuilderTest, ReportsTheFirstError) {
  Recipe recipe = CoarseRecipe();
  recipe.ct.hu_offset.reset();
  EXPECT_THAT(BuildPlan(BundledCt(), recipe),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("hu_offset")));
  recipe = CoarseRecipe();
  recipe.segments[0].planes = {{Eigen::Vector3d(0, 0, 5000), Eigen::Vector3d::UnitZ()}};
  EXPECT_THAT(BuildPlan(BundledCt(), recipe),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mandible")));
  recipe = CoarseRecipe();
  recipe.segments[0].pose.translation_mm = {0, -300, 0};
  EXPECT_THAT(BuildPlan(BundledCt(), recipe),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("segment \"mandible\" moves some of its bone by 300.0 mm")));
}

constexpr DeformationModel kModels[] = {DeformationModel::kGradientField, DeformationModel::kArap,
                                        DeformationModel::kLinearElastic,
                                        DeformationModel::kNeoHookean};

// The demo drags the bundled jaw to 8 mm.
TEST(PlanBuilderTest, RebuiltPlanCanBeDraggedBeyondItsMoveByAnyModel) {
  SetBlasThreads(1);
  ASSERT_OK_AND_ASSIGN(const Recipe recipe, ReadRecipe(TestDataPath("plans/head/recipe.json")));
  ASSERT_OK_AND_ASSIGN(const PlanBuild build,
                       BuildPlan(BundledCt(), recipe, {.threads = 2, .on_stage = {}}));
  ASSERT_OK_AND_ASSIGN(PlanProblem problem, ToPlanProblem(build));
  problem.deformer.preparation.threads = 2;
  for (const DeformationModel model : kModels) {
    problem.deformer.model = model;
    ASSERT_OK_AND_ASSIGN(
        const auto deformer,
        CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer));
    for (const double translation_mm : {6.0, 8.0}) {
      problem.poses[0].translation_mm = {0, -translation_mm, 0};
      ASSERT_OK_AND_ASSIGN(const Deformation answer, deformer->Deform(problem.poses));
      EXPECT_EQ(MeasureDeformation(*problem.mesh, answer.positions).inverted_tets, 0)
          << std::string(ModelName(model)) << " " << translation_mm;
    }
  }
}

TEST(PlanBuilderTest, BytesDoNotDependOnThreads) {
  SetBlasThreads(1);
  Recipe recipe = CoarseRecipe();
  const std::string folder = ::testing::TempDir() + "plan_threads_test";
  std::vector<std::string> plans;
  std::vector<std::string> meshes;
  for (const int threads : {1, 2, 3}) {
    ASSERT_OK_AND_ASSIGN(const PlanBuild build,
                         BuildPlan(BundledCt(), recipe, {.threads = threads, .on_stage = {}}));
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    ASSERT_THAT(WritePlan(build, folder), IsOk());
    plans.push_back(testing::BytesOfFile(folder + "/plan.json"));
    meshes.push_back(testing::BytesOfFile(folder + "/head.vtu") +
                     testing::BytesOfFile(folder + "/viewer.glb"));
  }
  std::filesystem::remove_all(folder);
  EXPECT_GT(meshes[0].size(), 100000U);
  for (size_t i = 1; i < plans.size(); ++i) {
    EXPECT_EQ(plans[i], plans[0]);
    EXPECT_TRUE(meshes[i] == meshes[0]);
  }
}

// How far the foremost vertex of a place of the skin moves.
double MovementOf(const PlanProblem& problem, const Positions& deformed, SkinRegion region) {
  const auto places = SkinPlaces(problem.point_data);
  const SkinPlace* place = places.ok() ? FindPlace(*places, SkinRegionName(region)) : nullptr;
  if (place == nullptr) return std::numeric_limits<double>::quiet_NaN();
  const Positions& rest = problem.mesh->positions();
  const int32_t foremost = ForemostVertex(rest, place->vertices);
  return (deformed.row(foremost) - rest.row(foremost)).norm();
}

// What the README promises of the bundled plans, by every model.
class BundledPlanTest : public ::testing::TestWithParam<std::tuple<const char*, DeformationModel>> {
};

TEST_P(BundledPlanTest, PlannedMoveInvertsNoTetAndMovesTheBoneExactly) {
  SetBlasThreads(1);  // as the commands do: more would wait for each other beside other tests
  const auto [name, model] = GetParam();
  ASSERT_OK_AND_ASSIGN(const Plan plan,
                       ReadPlan(TestDataPath(std::string("plans/") + name + "/plan.json")));
  ASSERT_OK_AND_ASSIGN(PlanProblem problem, ResolvePlan(plan));
  problem.deformer.model = model;
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateDeformer(*problem.mesh, problem.stiffness,
                                                           problem.constraints, problem.deformer));
  ASSERT_OK_AND_ASSIGN(const Deformation answer, deformer->Deform(problem.poses));
  EXPECT_TRUE(answer.summary.converged);
  EXPECT_EQ(MeasureDeformation(*problem.mesh, answer.positions).inverted_tets, 0);
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    for (const int32_t v : problem.constraints.handles()[h].vertices) {
      const Eigen::Vector3d rest = problem.mesh->positions().row(v);
      const Eigen::Vector3d moved = answer.positions.row(v);
      ASSERT_LT((moved - ApplyPose(problem.poses[h], rest)).norm(), 1e-9);
    }
  }
  if (std::string_view(name) == "three_segments") {
    // The bone moves by 10.7 mm at the chin, by 4.5 under the upper lip.
    const double chin_mm = MovementOf(problem, answer.positions, SkinRegion::kChin);
    EXPECT_GT(chin_mm, 6);
    EXPECT_LT(chin_mm, 11);
    const double lip_mm = MovementOf(problem, answer.positions, SkinRegion::kUpperLip);
    EXPECT_GT(lip_mm, 2);
    EXPECT_LT(lip_mm, 6);
  }
}

INSTANTIATE_TEST_SUITE_P(Plans, BundledPlanTest,
                         ::testing::Combine(::testing::Values("head", "head_maxilla", "head_chin",
                                                              "head_lips", "three_segments"),
                                            ::testing::ValuesIn(kModels)),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param)) + "_" +
                                  std::string(ModelName(std::get<1>(test.param)));
                         });

TEST(BundledMandibleTest, ChinFollowsTheJawAndTheNoseDoesNot) {
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(TestDataPath("plans/head/plan.json")));
  ASSERT_OK_AND_ASSIGN(PlanProblem problem, ResolvePlan(plan));
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kLinearElastic}) {
    problem.deformer.model = model;
    ASSERT_OK_AND_ASSIGN(
        const auto deformer,
        CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer));
    ASSERT_OK_AND_ASSIGN(const Deformation answer, deformer->Deform(problem.poses));
    EXPECT_GE(MovementOf(problem, answer.positions, SkinRegion::kChin), 4);
    EXPECT_LE(MovementOf(problem, answer.positions, SkinRegion::kChin), 6.5);
    EXPECT_LT(MovementOf(problem, answer.positions, SkinRegion::kNose), 1);
  }
}

TEST(BundledThreeSegmentsPlanTest, MatchesItsRecipe) {
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(TestDataPath("plans/three_segments/plan.json")));
  ASSERT_OK_AND_ASSIGN(const Recipe recipe,
                       ReadRecipe(TestDataPath("plans/three_segments/recipe.json")));
  ASSERT_EQ(plan.handles.size(), 3U);
  ASSERT_EQ(recipe.segments.size(), 3U);
  for (size_t h = 0; h < 3; ++h) {
    const RecipeSegment& segment = recipe.segments[h];
    EXPECT_EQ(plan.handles[h].name, segment.name);
    EXPECT_LT((plan.handles[h].pose.rotation_vector - segment.pose.rotation_vector).norm(), 1e-12);
    EXPECT_EQ(plan.handles[h].pose.pivot_mm, segment.pose.pivot_mm);
    EXPECT_EQ(plan.handles[h].pose.translation_mm, segment.pose.translation_mm);
  }
  EXPECT_EQ(recipe.segments[0].kind, OsteotomyKind::kLeFort1);
  EXPECT_EQ(recipe.segments[1].kind, OsteotomyKind::kBssro);
  EXPECT_EQ(recipe.segments[2].kind, OsteotomyKind::kGenioplasty);
}

}  // namespace
}  // namespace tissueform
