// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <limits>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/bar_mesh.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class CompareTest : public CliTest {
 protected:
  // a.vtu is the bar; b.vtu the same with its fixed layer moved by (3, 4, 0).
  void SetUp() override {
    CliTest::SetUp();
    TetMeshFile bar = BarMeshOfPlan();
    ASSERT_THAT(WriteTetMesh(Path("a.vtu"), bar), IsOk());
    Positions positions = bar.mesh.positions();
    positions.topRows(25).rowwise() += Eigen::RowVector3d(3, 4, 0);
    ASSERT_OK_AND_ASSIGN(bar.mesh, TetMesh::Create(positions, bar.mesh.tets()));
    ASSERT_THAT(WriteTetMesh(Path("b.vtu"), bar), IsOk());
  }
};

TEST_F(CompareTest, DistancesAreTakenOverallAndByRegion) {
  const ProcessResult result = Run({"compare", "a.vtu", "b.vtu", "--by", "anatomy", "--json"});
  ASSERT_THAT(result, Succeeds());
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json["overall"]["vertices"], 325);
  EXPECT_NEAR(json["overall"]["mean_mm"].get<double>(), 5.0 * 25 / 325, 1e-12);
  EXPECT_NEAR(json["overall"]["max_mm"].get<double>(), 5, 1e-12);
  EXPECT_EQ(json["overall"]["p50_mm"], 0);
  EXPECT_EQ(json["regions"]["1"]["vertices"], 25);
  EXPECT_NEAR(json["regions"]["1"]["p50_mm"].get<double>(), 5, 1e-12);
  EXPECT_EQ(json["regions"]["2"]["max_mm"], 0);
}

TEST_F(CompareTest, TableHasOneRowForEachRegion) {
  const ProcessResult result = Run({"compare", "a.vtu", "b.vtu", "--by", "anatomy"});
  ASSERT_THAT(result, Succeeds());
  for (const char* row : {"all ", "anatomy = 0", "anatomy = 1", "anatomy = 2"}) {
    EXPECT_THAT(result.out, HasSubstr(row));
  }
}

TEST_F(CompareTest, DifferenceFileHoldsTheDistances) {
  ASSERT_THAT(Run({"compare", "a.vtu", "b.vtu", "--out", "difference.vtu"}), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(Path("difference.vtu")));
  const Attribute* distance = FindAttribute(file.point_data, "distance_mm");
  ASSERT_NE(distance, nullptr);
  EXPECT_NEAR(ToDoubles(*distance).front(), 5, 1e-12);
  EXPECT_EQ(ToDoubles(*distance).back(), 0);
  EXPECT_NE(FindAttribute(file.point_data, "anatomy"), nullptr);
}

TEST_F(CompareTest, DifferenceFileHoldsTheVectorsFromAToB) {
  ASSERT_THAT(Run({"compare", "a.vtu", "b.vtu", "--out", "difference.vtu"}), Succeeds());
  ASSERT_OK_AND_ASSIGN(const TetMeshFile file, ReadTetMesh(Path("difference.vtu")));
  const Attribute* difference = FindAttribute(file.point_data, "difference_mm");
  ASSERT_NE(difference, nullptr);
  ASSERT_EQ(difference->components, 3);
  const std::vector<double> values = ToDoubles(*difference);
  EXPECT_NEAR(values[0], 3, 1e-12);
  EXPECT_NEAR(values[1], 4, 1e-12);
  EXPECT_EQ(values[2], 0);
  EXPECT_EQ(values.back(), 0);
}

TEST_F(CompareTest, SkinIsTheBoundaryOfTheMesh) {
  const ProcessResult result = Run({"compare", "a.vtu", "b.vtu", "--json"});
  ASSERT_THAT(result, Succeeds());
  const nlohmann::json skin = nlohmann::json::parse(result.out)["skin"];
  // 4 x 4 x 12 cells: 325 vertices, 3 x 3 x 11 of them inside.
  EXPECT_EQ(skin["vertices"], 325 - 99);
  EXPECT_NEAR(skin["mean_mm"].get<double>(), 5.0 * 25 / (325 - 99), 1e-12);
}

TEST_F(CompareTest, CsvHasARowForEachRegion) {
  ASSERT_THAT(Run({"compare", "a.vtu", "b.vtu", "--by", "anatomy", "--csv", "figures.csv"}),
              Succeeds());
  const std::string csv = Read("figures.csv");
  EXPECT_THAT(csv,
              StartsWith("region,vertices,mean_mm,p50_mm,p90_mm,p95_mm,max_mm,notice\nall,325,"));
  EXPECT_THAT(csv, HasSubstr("\nskin,226,"));
  EXPECT_THAT(csv,
              HasSubstr("\nanatomy = 1,25,5,5,5,5,5,research software - not a medical device\n"));
}

TEST_F(CompareTest, MeshesOfDifferentSizeCannotBeCompared) {
  EXPECT_THAT(
      Run({"compare", "a.vtu", TestDataPath("meshes/tet_sofa_tongue/volumetricTongue.vtu")}),
      FailsWith(1, HasSubstr("2238")));
}

TEST_F(CompareTest, RegionsNeedAnArrayOfWholeNumbers) {
  EXPECT_THAT(Run({"compare", "a.vtu", "b.vtu", "--by", "tissue"}),
              FailsWith(1, HasSubstr("it has anatomy")));
  TetMeshFile bar = BarMeshOfPlan();
  bar.point_data[0].values = std::vector<double>(static_cast<size_t>(bar.mesh.num_vertices()), 0.5);
  ASSERT_THAT(WriteTetMesh(Path("half.vtu"), bar), IsOk());
  EXPECT_THAT(Run({"compare", "half.vtu", "b.vtu", "--by", "anatomy"}),
              FailsWith(1, HasSubstr("labels are whole numbers")));
}

TEST_F(CompareTest, CoordinatesThatAreNotFiniteAreRefused) {
  TetMeshFile bar = BarMeshOfPlan();
  Positions positions = bar.mesh.positions();
  positions(3, 2) = std::numeric_limits<double>::quiet_NaN();
  ASSERT_OK_AND_ASSIGN(bar.mesh, TetMesh::Create(positions, bar.mesh.tets()));
  ASSERT_THAT(WriteTetMesh(Path("nan.vtu"), bar), IsOk());
  EXPECT_THAT(Run({"compare", "a.vtu", "nan.vtu"}),
              FailsWith(1, HasSubstr("nan.vtu has non-finite coordinates")));
}

}  // namespace
}  // namespace tissueform::testing
