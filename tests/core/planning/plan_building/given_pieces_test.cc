// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/given_pieces.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/core/planning/plan_building/coarse_recipe.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::TestDataPath;

// The lower jaw of the bundled head, cut and exported, comes back as a surface.
class GivenPiecesTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    absl::StatusOr<PlanBuild> build = Build(Cut());
    ASSERT_THAT(build.status(), IsOk());
    cut = new PlanBuild(*std::move(build));
  }
  static void TearDownTestSuite() {
    delete cut;
    cut = nullptr;
  }
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/given_pieces";
    std::filesystem::create_directories(folder_);
    recipe_ = Cut();
    recipe_.segments[0].pose = {};
    recipe_.segments[0].kind_given = false;
    recipe_.segments[0].surface =
        SurfaceSource{.file = Path("jaw.ply"), .flip = false, .wrap_mm = {}};
    recipe_.segments[0].move.transform = Path("jaw.tfm");
    WriteJaw(Jaw().positions());
    std::ofstream(Path("jaw.tfm")) << "#Insight Transform File V1.0\n#Transform 0\n"
                                      "Transform: TranslationTransform_double_3_3\n"
                                      "Parameters: 0 6 0\nFixedParameters:\n";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static Recipe Cut() {
    Recipe recipe = testing::CoarseRecipe();
    recipe.ct.hu_offset = -1024;
    recipe.ct.axes = "RPI";
    return recipe;
  }
  static absl::StatusOr<PlanBuild> Build(const Recipe& recipe) {
    return BuildPlan(TestDataPath("ct/headsq/headsq_quarter.nhdr"), recipe,
                     {.threads = 2, .on_stage = {}});
  }
  static const TriangleMesh& Jaw() { return cut->segments[0].surface; }
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }
  void WriteJaw(const Positions& positions) const {
    ASSERT_THAT(WriteTriangleMesh(Path("jaw.ply"),
                                  {.mesh = *TriangleMesh::Create(positions, Jaw().triangles()),
                                   .point_data = {},
                                   .cell_data = {}}),
                IsOk());
  }
  std::string Refusal() const {
    const absl::StatusOr<PlanBuild> build = Build(recipe_);
    EXPECT_FALSE(build.ok());
    const std::string message(build.status().message());
    EXPECT_EQ(message.find('\n'), std::string::npos);
    EXPECT_THAT(message, HasSubstr("segment \"mandible\""));
    return message;
  }
  // Voxels whose label the two plans disagree on, as a part of the segment.
  static double Disagreement(const PlanBuild& build) {
    int64_t differ = 0;
    for (size_t i = 0; i < build.bone.values.size(); ++i) {
      if (build.bone.values[i] != cut->bone.values[i]) ++differ;
    }
    const auto segment =
        std::count(cut->bone.values.begin(), cut->bone.values.end(), kFirstSegment);
    return static_cast<double>(differ) / static_cast<double>(segment);
  }

  static PlanBuild* cut;
  std::string folder_;
  Recipe recipe_;
};
PlanBuild* GivenPiecesTest::cut = nullptr;

TEST_F(GivenPiecesTest, SurfaceOfACutPieceGivesThePlanOfTheCut) {
  const absl::StatusOr<PlanBuild> build = Build(recipe_);
  ASSERT_THAT(build.status(), IsOk());
  EXPECT_LT(Disagreement(*build), 0.02);
  EXPECT_EQ(build->segments[0].pose.translation_mm, Eigen::Vector3d(0, -6, 0));
  EXPECT_TRUE(build->segments[0].cut.planes.empty());
  EXPECT_EQ(build->recipe.segments[0].kind, OsteotomyKind::kBssro);
  EXPECT_THAT(build->ct.notes, Contains(HasSubstr("moves 6.0 mm forward")));
  EXPECT_THAT(build->ct.notes, Contains(HasSubstr("LPS is assumed")));
  EXPECT_THAT(build->ct.notes, Contains(HasSubstr("lies on bone of the CT")));
}

// Smoothed surfaces lie inside the bone by a part of a voxel, and are often open.
TEST_F(GivenPiecesTest, ThinnerOpenSurfaceLeavesNoShellOfBoneBehind) {
  const Eigen::RowVector3d middle = Jaw().positions().colwise().mean();
  Positions thinner = Jaw().positions();
  thinner = (thinner.rowwise() - middle) * 0.97;
  thinner.rowwise() += middle;
  TriangleIndices open = Jaw().triangles().topRows(Jaw().num_triangles() - 30);
  ASSERT_THAT(WriteTriangleMesh(Path("jaw.ply"), {.mesh = *TriangleMesh::Create(thinner, open),
                                                  .point_data = {},
                                                  .cell_data = {}}),
              IsOk());
  const absl::StatusOr<PlanBuild> build = Build(recipe_);
  ASSERT_THAT(build.status(), IsOk());
  EXPECT_LT(Disagreement(*build), 0.12);
  EXPECT_THAT(build->ct.notes, Contains(HasSubstr("is open")));
}

TEST_F(GivenPiecesTest, PieceInOtherAxesOrUnitsIsRefusedWithTheReason) {
  const Eigen::Vector3d turn(-1, -1, 1);
  WriteJaw(Jaw().positions() * turn.asDiagonal());
  EXPECT_THAT(Refusal(), HasSubstr("give \"surfaces\": {\"coordinate_system\": \"RAS\"}"));
  WriteJaw(Jaw().positions() / 1000);
  EXPECT_THAT(Refusal(), HasSubstr("give \"surfaces\": {\"units\": \"m\"}"));
  recipe_.surface_axes.scale = 1000;
  EXPECT_THAT(Build(recipe_).status(), IsOk());
  recipe_.surface_axes = {};
  WriteJaw(Jaw().positions().rowwise() + Eigen::RowVector3d(0, 60, 0));
  EXPECT_THAT(Refusal(), HasSubstr("also not in other axes"));
}

TEST_F(GivenPiecesTest, RefusesInvalidPiecesAndMovements) {
  recipe_.segments[0].surface->flip = true;
  EXPECT_THAT(Refusal(), HasSubstr("inside out"));
  recipe_.segments[0].surface->flip = false;
  recipe_.segments[0].surface->file = Path("none.ply");
  EXPECT_THAT(Refusal(), HasSubstr("none.ply"));
  recipe_.segments[0].surface->file = Path("jaw.ply");
  std::ofstream(Path("jaw.tfm")) << "#Insight Transform File V1.0\nTransform: AffineTransform\n"
                                    "Parameters: 1.1 0 0 0 1 0 0 0 1 0 0 0\nFixedParameters:\n";
  EXPECT_THAT(Refusal(), HasSubstr("scales or shears"));
}

// Cut pieces take their movement from files as well.
TEST_F(GivenPiecesTest, CutPieceMovesByAFile) {
  Recipe recipe = Cut();
  recipe.segments[0].pose = {};
  recipe.segments[0].move = {.transform = Path("jaw.tfm"), .maps_forward = true, .moved = {}};
  std::vector<std::string> notes;
  const absl::StatusOr<SegmentFiles> files = ReadSegmentFiles(recipe, 1);
  ASSERT_THAT(files.status(), IsOk());
  ResolveMoves(*files, cut->landmarks, &recipe, &notes);
  EXPECT_EQ(recipe.segments[0].pose.translation_mm, Eigen::Vector3d(0, 6, 0));
  EXPECT_EQ(recipe.segments[0].pose.pivot_mm, cut->landmarks.lower_incisor);
  EXPECT_THAT(notes, Contains(HasSubstr("The lower incisor of segment \"mandible\" moves 6.0 mm "
                                        "backward")));
}

}  // namespace
}  // namespace tissueform
