// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/skin_comparison.h"

#include <cmath>
#include <random>
#include <vtkCellArray.h>
#include <vtkImplicitPolyDataDistance.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>

#include "gtest/gtest.h"

#include "core/mesh/skin_region.h"
#include "core/planning/case_file/viewer_file.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// A flat sheet of 2 x `cells` triangles in the plane y = 0 that faces forward (to -y).
TriangleMesh Sheet(int cells, double cell_mm) {
  Positions positions((cells + 1) * (cells + 1), 3);
  TriangleIndices triangles(2 * cells * cells, 3);
  Eigen::Index t = 0;
  for (int32_t i = 0; i <= cells; ++i) {
    for (int32_t k = 0; k <= cells; ++k) {
      const int32_t v = i * (cells + 1) + k;
      positions.row(v) << cell_mm * i, 0, cell_mm * k;
      if (i == cells || k == cells) continue;
      triangles.row(t++) << v, v + cells + 1, v + 1;
      triangles.row(t++) << v + 1, v + cells + 1, v + cells + 2;
    }
  }
  return *TriangleMesh::Create(positions, triangles);
}

TriangleMesh Shifted(const TriangleMesh& mesh, const Eigen::RowVector3d& by) {
  return *TriangleMesh::Create(mesh.positions().rowwise() + by, mesh.triangles());
}

TEST(SkinComparisonTest, ASheetInFrontIsSoFarInFrontBothWays) {
  const TriangleMesh sheet = Sheet(10, 2);
  ComparedFace predicted{sheet.positions(), sheet.triangles(), std::vector<uint8_t>(121, 3)};
  const SignedSurface real(Shifted(sheet, {0, -2.5, 0}));
  const std::vector<RegionComparison> comparisons = CompareFaces(predicted, real);
  ASSERT_EQ(comparisons.size(), 2U);
  EXPECT_EQ(comparisons[0].region, "chin");
  EXPECT_EQ(comparisons[1].region, "face");
  // The border of both sheets is at one place and is not compared.
  EXPECT_NEAR(comparisons[0].predicted_to_real.mean_mm, 2.5, 1e-9);
  EXPECT_NEAR(comparisons[0].real_to_predicted.mean_mm, 2.5, 1e-9);
  EXPECT_NEAR(comparisons[0].predicted_to_real.share_over_2mm, 1, 1e-9);
  EXPECT_NEAR(comparisons[0].predicted_to_real.area_cm2, 3.24, 1e-9);
  EXPECT_NEAR(comparisons[0].compared_share, 0.81, 1e-9);
}

TEST(SkinComparisonTest, ComparesOnlySkinThatTheOperatedSurfaceReaches) {
  const TriangleMesh sheet = Sheet(20, 1);
  ComparedFace predicted{sheet.positions(), sheet.triangles(), std::vector<uint8_t>(441, 1)};
  const SignedSurface half(Shifted(Sheet(10, 1), {0, 1, 0}));
  const std::vector<RegionComparison> comparisons = CompareFaces(predicted, half);
  EXPECT_NEAR(comparisons[0].predicted_to_real.mean_mm, -1, 1e-9);
  EXPECT_NEAR(comparisons[0].predicted_to_real.max_mm, 1, 1e-9);
  EXPECT_LT(comparisons[0].compared_share, 0.25);
}

TEST(SkinComparisonTest, PercentilesAreOfTheArea) {
  const DistanceStatistics found = Summarize({.mm = {1, -3, 2}, .area_mm2 = {50, 10, 40}});
  EXPECT_DOUBLE_EQ(found.mean_mm, 1.0);
  EXPECT_DOUBLE_EQ(found.mean_absolute_mm, 1.6);
  EXPECT_DOUBLE_EQ(found.p50_mm, 1);
  EXPECT_DOUBLE_EQ(found.p90_mm, 2);
  EXPECT_DOUBLE_EQ(found.p95_mm, 3);
  EXPECT_DOUBLE_EQ(found.max_mm, 3);
  EXPECT_DOUBLE_EQ(found.share_over_1mm, 0.5);
  EXPECT_DOUBLE_EQ(found.share_over_2mm, 0.1);
}

// VTK's distance of a point is negative inside, as ours.
TEST(SkinComparisonTest, SignedDistancesOfAHeadAreThoseOfVtk) {
  ASSERT_OK_AND_ASSIGN(const ViewerFile viewer,
                       ReadViewer(testing::TestDataPath("plans/head/viewer.glb")));
  const CaseSurface& skin = viewer.surfaces.front();
  const TriangleMesh mesh = *TriangleMesh::Create(skin.positions.cast<double>(), skin.triangles);
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  for (const auto& p : mesh.positions().rowwise()) points->InsertNextPoint(p[0], p[1], p[2]);
  vtkNew<vtkCellArray> cells;
  for (const auto& t : mesh.triangles().rowwise()) cells->InsertNextCell({t[0], t[1], t[2]});
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  vtkNew<vtkImplicitPolyDataDistance> distance;
  distance->SetInput(data);

  // Skin points moved by up to 3 mm.
  std::mt19937 random(11);
  std::uniform_real_distribution<double> way(-3, 3);
  Positions places(2000, 3);
  for (Eigen::Index i = 0; i < places.rows(); ++i) {
    places.row(i) = mesh.positions().row(i * mesh.num_vertices() / places.rows());
    for (double& value : places.row(i)) value += way(random);
  }
  const SignedDistances ours = SignedSurface(mesh).Of(places);
  for (Eigen::Index i = 0; i < places.rows(); ++i) {
    if (ours.beyond_border[static_cast<size_t>(i)]) continue;
    Eigen::Vector3d place = places.row(i);
    EXPECT_NEAR(ours.mm[i], distance->EvaluateFunction(place.data()), 1e-6) << place.transpose();
  }
}

}  // namespace
}  // namespace tissueform
