// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/cut_tets.h"

#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

// By the divergence theorem, from triangles that face outwards.
double EnclosedVolume(const SurfaceLayer& surface) {
  double volume = 0;
  for (const auto& corners : surface.triangles.rowwise()) {
    const Eigen::Vector3d a = surface.positions.row(corners[0]);
    const Eigen::Vector3d b = surface.positions.row(corners[1]);
    const Eigen::Vector3d c = surface.positions.row(corners[2]);
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

TEST(CutTetsTest, CutPartsEncloseTheVolumeOfTheirTets) {
  const TetMesh bar = testing::Bar({3, 3, 6}, 1.0, 0.2);
  const Plane up{{0, 0, 2.9}, Eigen::Vector3d::UnitZ()};
  const Plane down{up.point_mm, -up.normal};
  const std::vector<Colour> colours(static_cast<size_t>(bar.num_tets()), kBlue);
  const double whole = TetVolumes(bar.positions(), bar.tets()).sum();
  const double above = EnclosedVolume(CutTets(bar, up, colours));
  EXPECT_NEAR(above + EnclosedVolume(CutTets(bar, down, colours)), whole, 1e-9 * whole);
  EXPECT_NEAR(above, whole * 3.1 / 6, 0.1 * whole);  // jagged along the cut
}

TEST(CutTetsTest, TrianglesHaveTheColourOfTheirTet) {
  const TetMesh bar = testing::Bar({2, 2, 2});
  std::vector<Colour> colours;
  for (Eigen::Index t = 0; t < bar.num_tets(); ++t) {
    double x = 0;
    for (int corner = 0; corner < 4; ++corner) x += bar.positions()(bar.tets()(t, corner), 0) / 4;
    colours.push_back(x < bar.positions().col(0).mean() ? kBlue : kOrange);
  }
  const Plane all{{0, 0, -1e3}, Eigen::Vector3d::UnitZ()};
  const SurfaceLayer layer = CutTets(bar, all, colours);
  ASSERT_EQ(layer.triangles.rows(), 48);  // two a square of the boundary
  for (Eigen::Index f = 0; f < layer.triangles.rows(); ++f) {
    double x = 0;
    for (int corner = 0; corner < 3; ++corner) {
      x += layer.positions(layer.triangles(f, corner), 0) / 3;
    }
    EXPECT_EQ(layer.triangle_colours[static_cast<size_t>(f)],
              x < bar.positions().col(0).mean() ? kBlue : kOrange);
  }
}

TEST(CutTetsTest, NothingBehindThePlaneGivesNoTriangles) {
  const TetMesh tet = testing::SingleTet();
  const Plane far{{0, 0, 1e3}, Eigen::Vector3d::UnitZ()};
  EXPECT_EQ(CutTets(tet, far, {kBlue}).triangles.rows(), 0);
}

}  // namespace
}  // namespace tissueform
