// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/lip_parting.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/validation.h"
#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_io.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/unpacked_archive.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::SharedDataPath;
using testing::StatusIs;
using testing::TestDataPath;

Recipe PartingRecipe() {
  Recipe recipe;
  recipe.spacing_mm = 2;
  recipe.mesh.edge_mm = 5;
  recipe.mesh.fine_edge_mm = 3.5;
  recipe.lips.part = true;
  recipe.model = DeformationModel::kLinearElastic;
  RecipeSegment mandible;
  mandible.name = "mandible";
  mandible.pose.translation_mm.y() = 6;
  recipe.segments = {mandible};
  return recipe;
}

// The bundled head's lips are apart: a given line parts the rest.
Recipe BundledRecipe() {
  Recipe recipe = PartingRecipe();
  recipe.ct.hu_offset = -1024;
  recipe.ct.axes = "RPI";
  recipe.lips.mouth_line_mm = {
      {-122, 52, -98}, {-110, 43, -100}, {-97, 41, -100}, {-84, 43, -100}, {-72, 52, -98}};
  return recipe;
}

std::string BundledCt() { return TestDataPath("ct/headsq/headsq_quarter.nhdr"); }

void ExpectSoundRows(const PlanBuild& build) {
  const PartedLips& lips = *build.lips;
  const auto doubles = static_cast<Eigen::Index>(lips.original_of_double.size());
  const Eigen::Index welded = build.mesh.mesh.num_vertices() - doubles;
  size_t lip_rows = 0;
  for (const ContactRow& row : lips.rows) {
    if (row.other != ContactRow::kBone) {
      ++lip_rows;
      ASSERT_GE(row.other, welded);
      EXPECT_EQ(row.vertex, lips.original_of_double[static_cast<size_t>(row.other - welded)]);
      continue;
    }
    EXPECT_NEAR(row.normal.dot(build.head_frame.superior), 0, 1e-9);
    EXPECT_TRUE(row.gap_mm == 0 || !row.bilateral);
    EXPECT_LE(row.gap_mm, 5);
    const uint8_t bone = build.regions.bone[static_cast<size_t>(row.vertex)];
    if (bone == 0) {
      EXPECT_FALSE(row.bilateral);  // air lies before the jaw
    } else {
      EXPECT_EQ(row.handle, bone - kFirstSegment);  // -1 for bone that stays
    }
  }
  EXPECT_EQ(lip_rows, lips.original_of_double.size());
  EXPECT_EQ(lips.contact.size(), static_cast<size_t>(build.mesh.mesh.num_vertices()));
  EXPECT_EQ(build.regions.anatomy.size(), lips.contact.size());
  EXPECT_EQ(build.regions.skin_region.size(), lips.contact.size());
}

// Pairs of the skin, between the corners, where the lips meet at the mouth line.
void ExpectSoundEdge(const PlanBuild& build) {
  const LipEdge& edge = build.lips->edge;
  EXPECT_EQ(edge.up, build.head_frame.superior);
  EXPECT_THAT(CheckLipEdge(edge, build.mesh.mesh.positions(), build.lips->rows), IsOk());
  const FaceAxes axes(build.landmarks);
  const std::vector<MouthLinePoint>& line = build.lips->line.points;
  for (const LipEdge::Pair& pair : edge.pairs) {
    const auto region_of = [&build](int32_t vertex) {
      return static_cast<SkinRegion>(build.regions.skin_region[static_cast<size_t>(vertex)]);
    };
    EXPECT_EQ(region_of(pair.upper), SkinRegion::kUpperLip);
    EXPECT_EQ(region_of(pair.lower), SkinRegion::kLowerLip);
    const FaceCoordinates at = axes.Of(build.mesh.mesh.positions().row(pair.upper));
    EXPECT_GT(at.left, line.front().at.left);
    EXPECT_LT(at.left, line.back().at.left);
    const auto nearest = std::ranges::min_element(
        line, {}, [&at](const MouthLinePoint& point) { return std::abs(point.at.left - at.left); });
    EXPECT_NEAR(at.front, nearest->at.front, 5) << at.left;
    EXPECT_FALSE(nearest->parted);
  }
}

TEST(LipPartingTest, ABundledHeadGetsASeamAndRowsThatItsFilesSay) {
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(BundledCt(), BundledRecipe()));
  ASSERT_TRUE(build.lips.has_value());
  EXPECT_TRUE(build.lips->line.given);
  EXPECT_GT(build.lips->original_of_double.size(), 5U);
  EXPECT_THAT(CheckTetMesh(build.mesh.mesh), IsOk());
  ExpectSoundRows(build);

  ASSERT_OK_AND_ASSIGN(const PlanProblem direct, ToPlanProblem(build));
  const std::string folder = ::testing::TempDir() + "lip_parting_test";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  ASSERT_THAT(WritePlan(build, folder), IsOk());
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(folder + "/plan.json"));
  ASSERT_OK_AND_ASSIGN(const PlanProblem read, ResolvePlan(plan));
  ASSERT_OK_AND_ASSIGN(const PlanProblem off, ResolvePlan(plan, {.contact = false}));
  std::filesystem::remove_all(folder);
  EXPECT_EQ(read.constraints.contact(), direct.constraints.contact());
  EXPECT_EQ(read.constraints.contact().size(), build.lips->rows.size());
  EXPECT_EQ(read.lip_edge, direct.lip_edge);
  EXPECT_EQ(read.lip_edge, std::nullopt) << "the lips are apart, and a seal is offered";
  EXPECT_EQ(read.mesh->positions(), direct.mesh->positions());
  const auto doubles = static_cast<Eigen::Index>(build.lips->original_of_double.size());
  EXPECT_EQ(off.mesh->num_vertices(), read.mesh->num_vertices() - doubles);
  EXPECT_TRUE(off.constraints.contact().empty());
}

TEST(LipPartingTest, RefusesAMouthLineOutsideTheTissue) {
  Recipe recipe = BundledRecipe();
  for (Eigen::Vector3d& place : recipe.lips.mouth_line_mm) place.z() += 300;
  EXPECT_THAT(BuildPlan(BundledCt(), recipe).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("between the lips")));
  recipe = BundledRecipe();
  std::swap(recipe.lips.mouth_line_mm[0], recipe.lips.mouth_line_mm[4]);
  EXPECT_THAT(BuildPlan(BundledCt(), recipe).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("from the right corner")));
}

// How far the skin of a region moves along y on average.
double MeanBackwardMm(const PlanBuild& build, const Positions& displacements, SkinRegion region) {
  double sum = 0;
  int count = 0;
  for (Eigen::Index v = 0; v < displacements.rows(); ++v) {
    if (build.regions.skin_region[static_cast<size_t>(v)] != static_cast<uint8_t>(region)) continue;
    sum += displacements(v, 1);
    ++count;
  }
  return sum / count;
}

// In occlusion, its lips closed. The lower jaw goes back by 6 mm.
TEST(LipPartingTest, WhenTheLowerJawOfAClosedMouthGoesBackTheUpperLipStays) {
  const std::string archive = SharedDataPath("ct_head_vhm_dicom/vhm_head_dicom.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const testing::UnpackedArchive files(archive, "'vhm_head/*'");
  ASSERT_TRUE(files.ok());
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(files.Path("vhm_head"), PartingRecipe()));
  ExpectSoundRows(build);
  ExpectSoundEdge(build);
  EXPECT_GT(build.lips->edge.pairs.size(), 8U);
  EXPECT_GT(build.lips->original_of_double.size(), 40U);
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, ToPlanProblem(build));
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateDeformer(*problem.mesh, problem.stiffness,
                                                           problem.constraints, problem.deformer));
  ASSERT_OK_AND_ASSIGN(const Deformation at_rest, deformer->Deform({HandlePose()}));
  EXPECT_LT((at_rest.positions - problem.mesh->positions()).cwiseAbs().maxCoeff(), 1e-6);
  ASSERT_OK_AND_ASSIGN(const Deformation moved, deformer->Deform(problem.poses));
  EXPECT_EQ(problem.lip_edge, build.lips->edge);
  const Positions displacements = moved.positions - problem.mesh->positions();
  const double upper_mm = MeanBackwardMm(build, displacements, SkinRegion::kUpperLip);
  const double lower_mm = MeanBackwardMm(build, displacements, SkinRegion::kLowerLip);
  EXPECT_GT(lower_mm, 4);
  EXPECT_LT(upper_mm, 0.25 * lower_mm);
  for (const ContactRow& row : build.lips->rows) {
    if (row.other == ContactRow::kBone) continue;
    const Eigen::Vector3d apart =
        (displacements.row(row.vertex) - displacements.row(row.other)).transpose();
    EXPECT_GT(row.normal.dot(apart), -1e-6);
  }
}

}  // namespace
}  // namespace tissueform
