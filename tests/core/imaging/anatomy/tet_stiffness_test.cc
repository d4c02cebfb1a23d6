// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/tet_stiffness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/imaging/anatomy/tet_voxels.h"
#include "core/mesh/bar_mesh.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;
using tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;
constexpr double kMuscleHu = 50;

GridGeometry Grid(int size, double spacing_mm) {
  GridGeometry grid;
  grid.size = {size, size, size};
  grid.spacing_mm = spacing_mm;
  return grid;
}

using VoxelFunction = std::function<int(int x, int y, int z)>;

template <typename T>
VoxelGrid<T> Fill(const GridGeometry& geometry, const VoxelFunction& value) {
  VoxelGrid<T> grid(geometry);
  for (int z = 0; z < geometry.size[2]; ++z) {
    for (int y = 0; y < geometry.size[1]; ++y) {
      for (int x = 0; x < geometry.size[0]; ++x) grid.At(x, y, z) = static_cast<T>(value(x, y, z));
    }
  }
  return grid;
}

// A cube of `cells` cells of six tets along each axis, from `low_mm` on; the vertices inside are
// moved by up to `jitter_mm`.
TetMesh Cube(int cells, double low_mm, double cell_mm, double jitter_mm = 0) {
  const std::vector<double> planes = EvenPlanes(low_mm, low_mm + cells * cell_mm, cells);
  const absl::StatusOr<TetMesh> even = BarMesh({planes, planes, planes});
  EXPECT_TRUE(even.ok()) << even.status();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> jitter(-jitter_mm, jitter_mm);
  Positions positions = even->positions();
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const bool inner =
        positions.row(v).minCoeff() > planes.front() && positions.row(v).maxCoeff() < planes.back();
    for (int axis = 0; inner && axis < 3; ++axis) positions(v, axis) += jitter(random);
  }
  return *TetMesh::Create(positions, even->tets());
}

// Smallest barycentric coordinate of a point in a tet: positive inside.
double Depth(const TetMesh& mesh, Eigen::Index tet, const Eigen::Vector3d& point) {
  Eigen::Matrix4d corners;
  for (int i = 0; i < 4; ++i) {
    corners.col(i) << mesh.positions().row(mesh.tets()(tet, i)).transpose(), 1;
  }
  return (corners.inverse() * point.homogeneous()).minCoeff();
}

std::vector<int> Owners(const TetMesh& mesh, const GridGeometry& grid) {
  std::vector<int> owners(static_cast<size_t>(grid.num_voxels()), -1);
  ForEachVoxelInTets(mesh, grid, [&](Eigen::Index tet, int x, int y, int z) {
    int& owner = owners[static_cast<size_t>(grid.Index(x, y, z))];
    EXPECT_EQ(owner, -1);
    owner = static_cast<int>(tet);
  });
  return owners;
}

TEST(TetVoxelsTest, VoxelsAreFoundAsByTryingAllTets) {
  const GridGeometry grid = Grid(24, 0.9);
  const TetMesh mesh = Cube(3, 1.3, 5.7, 1.2);
  const std::vector<int> owners = Owners(mesh, grid);
  for (int z = 0; z < 24; ++z) {
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 24; ++x) {
        const Eigen::Vector3d centre = grid.Centre(x, y, z);
        int expected = -1;
        for (int tet = 0; tet < mesh.num_tets() && expected < 0; ++tet) {
          if (Depth(mesh, tet, centre) > 1e-9) expected = tet;
        }
        if (expected < 0) continue;
        ASSERT_EQ(owners[static_cast<size_t>(grid.Index(x, y, z))], expected);
      }
    }
  }
}

TEST(TetVoxelsTest, CentresOnSharedFacesBelongToTheFirstTetAndNoneIsLost) {
  const GridGeometry grid = Grid(9, 1);
  const TetMesh mesh = Cube(2, 1, 3);  // vertices, edges and faces lie on voxel centres
  const std::vector<int> owners = Owners(mesh, grid);
  for (int z = 0; z < 9; ++z) {
    for (int y = 0; y < 9; ++y) {
      for (int x = 0; x < 9; ++x) {
        int expected = -1;
        for (int tet = 0; tet < mesh.num_tets() && expected < 0; ++tet) {
          if (Depth(mesh, tet, grid.Centre(x, y, z)) > -1e-9) expected = tet;
        }
        EXPECT_EQ(owners[static_cast<size_t>(grid.Index(x, y, z))], expected);
      }
    }
  }
  EXPECT_EQ(std::count(owners.begin(), owners.end(), -1), 9 * 9 * 9 - 7 * 7 * 7);
}

TEST(TetVoxelsTest, MeshMayReachBeyondTheGrid) {
  const GridGeometry grid = Grid(5, 1);
  const std::vector<int> owners = Owners(Cube(2, -20, 30), grid);
  EXPECT_EQ(std::count(owners.begin(), owners.end(), -1), 0);
  const std::vector<int> nowhere = Owners(Cube(2, 1e12, 30), grid);
  EXPECT_THAT(nowhere, Each(-1));
}

TEST(TetStiffnessTest, ConstantFieldGivesThatConstantEverywhere) {
  const GridGeometry grid = Grid(20, 1);
  const HuGrid hu = Fill<int16_t>(grid, [](int, int, int) { return -70; });
  const TetMesh mesh = Cube(6, 3.2, 2.1, 0.4);  // of some tets no voxel's centre is part
  ASSERT_OK_AND_ASSIGN(const TetStiffness result, ComputeTetStiffness(mesh, hu, LabelGrid(grid)));
  EXPECT_THAT(result.mean_hu, Each(::testing::DoubleNear(-70, 1e-9)));
  EXPECT_THAT(result.tissue, Each(0));
  EXPECT_THAT(result.youngs_modulus_pa, Each(16e3));
  EXPECT_GT(result.from_barycentre, 0);
  EXPECT_EQ(result.from_voxels + result.from_barycentre, mesh.num_tets());
}

TEST(TetStiffnessTest, MeansAndCountsAreThoseOfTheVoxelsInEachTet) {
  const GridGeometry grid = Grid(20, 1);
  std::mt19937 random(9);
  std::uniform_int_distribution<int> value(-150, 200);
  const HuGrid hu = Fill<int16_t>(grid, [&](int, int, int) { return value(random); });
  // Moved so that no centre lies on the face of a tet: whose it would be is another test's
  // question.
  const TetMesh cube = Cube(3, 2.17, 5, 0.9);
  const TetMesh mesh = *TetMesh::Create(
      cube.positions().rowwise() + Eigen::RowVector3d(0.0137, 0.0291, -0.0053), cube.tets());
  ASSERT_OK_AND_ASSIGN(const TetStiffness result, ComputeTetStiffness(mesh, hu, LabelGrid(grid)));
  for (Eigen::Index tet = 0; tet < mesh.num_tets(); ++tet) {
    double sum = 0;
    int count = 0;
    for (size_t voxel = 0; voxel < hu.values.size(); ++voxel) {
      const auto v = static_cast<int>(voxel);
      if (Depth(mesh, tet, grid.Centre(v % 20, v / 20 % 20, v / 400)) <= 0) continue;
      sum += hu.values[voxel];
      ++count;
    }
    const auto t = static_cast<size_t>(tet);
    EXPECT_EQ(result.voxels[t], count);
    if (count == 0) continue;
    EXPECT_NEAR(result.mean_hu[t], sum / count, 1e-9);
  }
}

TEST(TetStiffnessTest, TetWithoutVoxelTakesTheLinearValueAtItsBarycentre) {
  const GridGeometry grid = Grid(12, 2);
  const auto linear = [](double x, double y, double z) { return 4 * x - 6 * y + 2 * z + 20; };
  const HuGrid hu =
      Fill<int16_t>(grid, [&](int x, int y, int z) { return static_cast<int>(linear(x, y, z)); });
  const TetMesh mesh = Cube(1, 6.3, 1.1);  // between the centres at 6 and 8 mm
  ASSERT_OK_AND_ASSIGN(const TetStiffness result, ComputeTetStiffness(mesh, hu, LabelGrid(grid)));
  EXPECT_EQ(result.from_barycentre, mesh.num_tets());
  for (Eigen::Index tet = 0; tet < mesh.num_tets(); ++tet) {
    Eigen::RowVector3d place = Eigen::RowVector3d::Zero();
    for (int i = 0; i < 4; ++i) place += mesh.positions().row(mesh.tets()(tet, i)) / (4 * 2.0);
    const auto t = static_cast<size_t>(tet);
    EXPECT_NEAR(result.mean_hu[t], linear(place[0], place[1], place[2]), 1e-9);
    EXPECT_EQ(result.voxels[t], 0);
  }
}

// Bone from x = 10 on, air under x = 4, muscle between; the CT blurs both edges over one voxel.
int BlurredHu(int x) {
  if (x < 3) return -1000;
  if (x == 3) return -450;
  if (x == 9) return 550;
  return x > 9 ? 1200 : static_cast<int>(kMuscleHu);
}

TEST(TetStiffnessTest, PartialVolumeAtBoneAndAirDoesNotChangeTheTissue) {
  const GridGeometry grid = Grid(20, 1);
  const HuGrid hu = Fill<int16_t>(grid, [](int x, int, int) { return BlurredHu(x); });
  const LabelGrid bone = Fill<uint8_t>(grid, [](int x, int, int) { return x >= 10 ? 1 : 0; });
  // From the middle of the skin's edge to the bone's face, tets of one and of three voxels.
  for (const int cells : {2, 6}) {
    const TetMesh mesh = Cube(cells, 3.5, 6.0 / cells);
    ASSERT_OK_AND_ASSIGN(const TetStiffness result, ComputeTetStiffness(mesh, hu, bone));
    EXPECT_THAT(result.mean_hu, Each(::testing::DoubleNear(kMuscleHu, 1e-9)));
    EXPECT_THAT(result.tissue, Each(1));
    // Without the rule the voxels at the bone's edge would have stiffened it.
    ASSERT_OK_AND_ASSIGN(const TetStiffness naive,
                         ComputeTetStiffness(mesh, hu, LabelGrid(grid), {.air_below_hu = -2000}));
    EXPECT_GT(*std::max_element(naive.mean_hu.begin(), naive.mean_hu.end()), 150);
  }
}

TEST(TetStiffnessTest, TetDeepInBoneUsesBoneVoxels) {
  const GridGeometry grid = Grid(20, 1);
  const HuGrid hu = Fill<int16_t>(grid, [](int, int, int) { return 1200; });
  const LabelGrid bone(grid, 1);
  ASSERT_OK_AND_ASSIGN(const TetStiffness result, ComputeTetStiffness(Cube(1, 5.5, 4), hu, bone));
  EXPECT_EQ(result.from_mixed_voxels, 6);
  EXPECT_THAT(result.mean_hu, Each(1200));
  EXPECT_THAT(result.tissue, Each(2));
  EXPECT_EQ(std::accumulate(result.voxels.begin(), result.voxels.end(), 0), 64);
}

TEST(TetStiffnessTest, RefusesInconsistentInput) {
  const GridGeometry grid = Grid(20, 1);
  const HuGrid hu(grid, 50);
  EXPECT_THAT(ComputeTetStiffness(Cube(1, 18, 4), hu, LabelGrid(grid)),
              StatusIs(kInvalid, HasSubstr("tet 0 is outside the CT")));
  EXPECT_THAT(ComputeTetStiffness(Cube(1, 5, 4), hu, LabelGrid(Grid(20, 1.1))),
              StatusIs(kInvalid, HasSubstr("same grid")));
  Positions positions = Cube(1, 5, 4).positions();
  positions(3, 1) = std::nan("");
  EXPECT_THAT(
      ComputeTetStiffness(*TetMesh::Create(positions, Cube(1, 5, 4).tets()), hu, LabelGrid(grid)),
      StatusIs(kInvalid, HasSubstr("finite")));
  EXPECT_THAT(ComputeTetStiffness(Cube(1, 5, 4), hu, LabelGrid(grid), {.table = {}}),
              StatusIs(kInvalid, HasSubstr("empty")));
}

TEST(StiffnessTableTest, EveryNumberHasOneClass) {
  const StiffnessTable table = DefaultStiffnessTable();
  EXPECT_TRUE(CheckStiffnessTable(table).ok());
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, -1000))].name, "fat");
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, -30.01))].name, "fat");
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, -30))].name, "muscle");
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, 149.9))].name, "muscle");
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, 150))].name, "dense");
  EXPECT_EQ(table[static_cast<size_t>(TissueOf(table, 4000))].name, "dense");
  for (const TissueClass& tissue : table) EXPECT_THAT(tissue.source, HasSubstr("doi"));
}

// Of a log-normal variable whose mean and deviation are those of the study.
TEST(StiffnessTableTest, FactorsAreThoseOfTheSpreadsThatWereMeasured) {
  const std::array<double, 3> deviations_pa = {5e3, 11e3, 21e3};
  const StiffnessTable table = DefaultStiffnessTable();
  for (size_t t = 0; t < table.size(); ++t) {
    const double part = deviations_pa[t] / table[t].youngs_modulus_pa;
    EXPECT_NEAR(table[t].factor_95, std::exp(1.96 * std::sqrt(std::log1p(part * part))), 0.05);
  }
}

TEST(StiffnessTableTest, WrongTablesAreRefusedByName) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  StiffnessTable many;
  for (int t = 0; t < 17; ++t) many.push_back({"tissue", 1.0 * t, 3e3, "", 2});
  EXPECT_THAT(CheckStiffnessTable(many), StatusIs(kInvalid, HasSubstr("at most 16")));
  EXPECT_THAT(CheckStiffnessTable({{"fat", 10, 3e3, "", 2}, {"skin", kNone, 3e3, ""}}),
              StatusIs(kInvalid, HasSubstr("\"skin\" differs")));
  EXPECT_THAT(CheckStiffnessTable({{"fat", 10, 3e3, ""}, {"skin", 5, 3e3, ""}}),
              StatusIs(kInvalid, HasSubstr("\"skin\" must be larger")));
  EXPECT_THAT(CheckStiffnessTable({{"fat", std::nan(""), 3e3, ""}, {"skin", kNone, 3e3, ""}}),
              StatusIs(kInvalid, HasSubstr("\"fat\" must be larger")));
  EXPECT_THAT(CheckStiffnessTable({{"fat", 10, 3e3, ""}}),
              StatusIs(kInvalid, HasSubstr("no \"hu_below\"")));
  for (const double modulus_pa : {0.0, -1.0, kNone, std::nan("")}) {
    EXPECT_THAT(CheckStiffnessTable({{"fat", kNone, modulus_pa, ""}}),
                StatusIs(kInvalid, HasSubstr("\"fat\" must be positive")));
  }
}

}  // namespace
}  // namespace tissueform
