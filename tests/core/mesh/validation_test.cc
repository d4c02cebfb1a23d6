// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/validation.h"

#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

// The short check must say of every mesh what the long one says.
MeshReport Validate(Positions positions, TetIndices tets) {
  const TetMesh mesh = *TetMesh::Create(std::move(positions), std::move(tets));
  MeshReport report = ValidateTetMesh(mesh);
  EXPECT_EQ(CheckTetMesh(mesh), CheckUsable(report));
  return report;
}

TEST(ValidationTest, GoodMeshHasNoDefect) {
  const MeshReport report = ValidateTetMesh(testing::Bar({2, 2, 3}, 1.0, 0.2));
  EXPECT_THAT(report.defects, IsEmpty());
  EXPECT_TRUE(report.usable());
  EXPECT_EQ(report.num_components, 1);
  EXPECT_THAT(CheckUsable(report), IsOk());
}

TEST(ValidationTest, InvertedTetIsFoundAndNamed) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  TetIndices tets = bar.tets();
  std::swap(tets(17, 0), tets(17, 1));
  const MeshReport report = Validate(bar.positions(), tets);
  const MeshDefect* defect = report.Find("inverted_tets");
  ASSERT_NE(defect, nullptr);
  EXPECT_EQ(defect->count, 1);
  EXPECT_THAT(defect->examples, ElementsAre(17));
  EXPECT_THAT(CheckUsable(report),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("negative volume"), HasSubstr("tet 17"))));
}

TEST(ValidationTest, FlatTetAndRepeatedVertexAreDegenerate) {
  Positions positions(4, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  EXPECT_NE(Validate(positions, tets).Find("degenerate_tets"), nullptr);
  positions(3, 2) = 1;
  EXPECT_EQ(Validate(positions, tets).Find("degenerate_tets"), nullptr);
  tets(0, 3) = 2;
  EXPECT_NE(Validate(positions, tets).Find("degenerate_tets"), nullptr);
}

TEST(ValidationTest, DegeneracyDoesNotDependOnTheUnit) {
  const TetMesh tet = testing::SingleTet();
  for (const double scale : {1e-9, 1.0, 1e9}) {
    EXPECT_TRUE(Validate(scale * tet.positions(), tet.tets()).usable()) << scale;
  }
}

TEST(ValidationTest, VolumeThatOverflowsIsDegenerate) {
  const TetMesh tet = testing::SingleTet();
  const MeshReport report = Validate(1e200 * tet.positions(), tet.tets());
  EXPECT_NE(report.Find("degenerate_tets"), nullptr);
  EXPECT_FALSE(report.usable());
}

TEST(ValidationTest, NonFiniteVertexIsFound) {
  const TetMesh tet = testing::SingleTet();
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Positions positions = tet.positions();
    positions(2, 1) = bad;
    const MeshReport report = Validate(positions, tet.tets());
    ASSERT_NE(report.Find("non_finite_vertices"), nullptr);
    EXPECT_THAT(report.Find("non_finite_vertices")->examples, ElementsAre(2));
    EXPECT_FALSE(report.usable());
  }
}

TEST(ValidationTest, DuplicateTetIsFoundInAnyVertexOrder) {
  const TetMesh tet = testing::SingleTet();
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 1, 2, 0, 3;
  const MeshReport report = Validate(tet.positions(), tets);
  ASSERT_NE(report.Find("duplicate_tets"), nullptr);
  EXPECT_THAT(report.Find("duplicate_tets")->examples, ElementsAre(1));
}

TEST(ValidationTest, FacetOfThreeTetsIsFound) {
  Positions positions(6, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0.2, 0.2, 1, 0.3, 0.3, 1, 0.1, 0.3, 1.2;
  TetIndices tets(3, 4);
  tets << 0, 1, 2, 3, 0, 1, 2, 4, 0, 1, 2, 5;
  const MeshReport report = Validate(positions, tets);
  ASSERT_NE(report.Find("overshared_facets"), nullptr);
  EXPECT_EQ(report.Find("overshared_facets")->count, 1);
  EXPECT_FALSE(report.usable());
}

TEST(ValidationTest, DuplicateAndUnreferencedVerticesAreWarnings) {
  Positions positions(6, 3);
  positions.topRows(4) = testing::SingleTet().positions();
  positions.row(4) = positions.row(1);
  positions.row(5) << 9, 9, 9;
  const MeshReport report = Validate(positions, testing::SingleTet().tets());
  ASSERT_NE(report.Find("duplicate_vertices"), nullptr);
  EXPECT_THAT(report.Find("duplicate_vertices")->examples, ElementsAre(4));
  ASSERT_NE(report.Find("unreferenced_vertices"), nullptr);
  EXPECT_THAT(report.Find("unreferenced_vertices")->examples, ElementsAre(4, 5));
  EXPECT_TRUE(report.usable());
}

TEST(ValidationTest, TwoTetsThatShareAnEdgeAreNonManifoldThere) {
  Positions positions(6, 3);
  positions << 0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, -1, 0, 0, -1, -1, 0;
  TetIndices tets(2, 4);
  tets << 0, 2, 3, 1, 0, 4, 5, 1;
  const MeshReport report = Validate(positions, tets);
  ASSERT_NE(report.Find("non_manifold_edges"), nullptr);
  EXPECT_EQ(report.Find("non_manifold_edges")->count, 1);
  EXPECT_TRUE(report.usable());
}

TEST(ValidationTest, SeparatePartsAreCounted) {
  const TetMesh tet = testing::SingleTet();
  Positions positions(8, 3);
  positions << tet.positions(), tet.positions().array() + 10.0;
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 4, 5, 6, 7;
  const MeshReport report = Validate(positions, tets);
  EXPECT_EQ(report.num_components, 2);
  ASSERT_NE(report.Find("several_components"), nullptr);
  EXPECT_THAT(report.Find("several_components")->examples, ElementsAre(0, 4));
}

// Two tets against each other: with shared vertices, with vertices of their own at the same places,
// and with two of three places the same.
TEST(ValidationTest, PartsThatTouchWithoutSharedVerticesAreFound) {
  Positions positions(8, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, -1;
  TetIndices joined(2, 4);
  joined << 0, 1, 2, 3, 0, 2, 1, 7;
  EXPECT_EQ(Validate(positions, joined).Find("non_matching_facets"), nullptr);
  TetIndices apart(2, 4);
  apart << 0, 1, 2, 3, 4, 6, 5, 7;
  const MeshReport report = Validate(positions, apart);
  ASSERT_NE(report.Find("non_matching_facets"), nullptr);
  EXPECT_EQ(report.Find("non_matching_facets")->count, 2);
  EXPECT_THAT(report.Find("non_matching_facets")->examples, ElementsAre(0, 4));
  EXPECT_TRUE(report.usable());
  positions(6, 1) = 1.5;
  EXPECT_EQ(Validate(positions, apart).Find("non_matching_facets"), nullptr);
}

TEST(ValidationTest, ReorientationOnReadingIsReportedAsAWarning) {
  const TetMesh bar = testing::Bar({1, 1, 1});
  EXPECT_EQ(ValidateTetMesh(bar).Find("reoriented_tets"), nullptr);
  const MeshReport report = ValidateTetMesh(bar, bar.num_tets());
  ASSERT_NE(report.Find("reoriented_tets"), nullptr);
  EXPECT_EQ(report.Find("reoriented_tets")->count, 6);
  EXPECT_TRUE(report.usable());
}

TEST(ValidationTest, CellsLeftOutOnReadingAreReportedAsAWarning) {
  const MeshReport report = ValidateTetMesh(testing::Bar({1, 1, 1}), 0, 12);
  ASSERT_NE(report.Find("left_out_cells"), nullptr);
  EXPECT_EQ(report.Find("left_out_cells")->count, 12);
  EXPECT_TRUE(report.usable());
}

TEST(ValidationTest, NegativeCotangentWeightsAreCountedAndNoDefect) {
  const MeshReport report =
      ValidateTetMesh(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"));
  EXPECT_GT(report.num_negative_cotangent_weights, 0);
  EXPECT_LT(report.num_negative_cotangent_weights, report.num_edges);
  EXPECT_EQ(report.num_edges, 14187);
}

// Facts from the SOURCE.md of the meshes, found with another program.
TEST(ValidationTest, PublicMeshesHaveTheirPublishedDefects) {
  const MeshReport tongue =
      ValidateTetMesh(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"));
  EXPECT_THAT(tongue.defects, IsEmpty());
  EXPECT_EQ(tongue.num_vertices, 2238);
  EXPECT_EQ(tongue.num_tets, 10980);

  const MeshReport raptor =
      ValidateTetMesh(testing::LoadTestMesh("meshes/tet_sofa_raptor/raptorTetra_8418.vtu"));
  ASSERT_NE(raptor.Find("non_manifold_edges"), nullptr);
  EXPECT_EQ(raptor.Find("non_manifold_edges")->count, 9);
  ASSERT_NE(raptor.Find("unreferenced_vertices"), nullptr);
  EXPECT_EQ(raptor.Find("unreferenced_vertices")->count, 3);
  EXPECT_EQ(raptor.num_boundary_facets, 5750);
  EXPECT_TRUE(raptor.usable());
}

TEST(ValidationTest, FurtherErrorsAreCountedInTheStatus) {
  Positions positions = testing::SingleTet().positions();
  TetIndices tets(2, 4);
  tets << 1, 0, 2, 3, 1, 0, 2, 3;
  EXPECT_THAT(CheckUsable(Validate(positions, tets)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("1 more kind")));
}

}  // namespace
}  // namespace tissueform
