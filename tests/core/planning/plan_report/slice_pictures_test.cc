// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/slice_pictures.h"

#include <algorithm>

#include "gtest/gtest.h"

#include "core/planning/plan_report/label_colours.h"
#include "tests/core/planning/plan_report/plan_build_of_mesh.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// A head of air, 40 mm wide, with one bright place that stands off the middle: at the patient's
// left, behind and above.
PlanBuild WithBrightPlace() {
  PlanBuild build = testing::PlanBuildOfMesh();
  const GridGeometry geometry{.size = {21, 21, 21}, .origin_mm = Vector3d::Zero(), .spacing_mm = 2};
  build.head.hu = HuGrid(geometry, -1000);
  build.bone = LabelGrid(geometry);
  build.soft_tissue.labels = LabelGrid(geometry);
  build.landmarks.midsagittal = {Vector3d(30, 20, 20), Vector3d::UnitX()};
  for (Vector3d* landmark : {&build.landmarks.lower_incisor, &build.landmarks.lower_molar.left,
                             &build.landmarks.lower_molar.right, &build.landmarks.condyle.left,
                             &build.landmarks.condyle.right}) {
    *landmark = Vector3d(20, 30, 32);
  }
  for (int z = 13; z <= 16; ++z) {
    for (int y = 14; y <= 16; ++y) {
      for (int x = 14; x <= 16; ++x) build.head.hu.At(x, y, z) = 1000;
    }
  }
  return build;
}

// Mean column and row, from -1 (left, top) to 1 (right, bottom), of all pixels that are not black.
Eigen::Vector2d BrightPlace(const Picture& picture) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double count = 0;
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < picture.width; ++column) {
      if (picture.rgb[3 * (static_cast<size_t>(row) * picture.width + column)] == 0) continue;
      sum += Eigen::Vector2d(2.0 * column / (picture.width - 1) - 1,
                             2.0 * row / (picture.height - 1) - 1);
      ++count;
    }
  }
  return sum / count;
}

TEST(SlicePicturesTest, SlicesLieInTheRadiologicalConvention) {
  const PlanBuild build = WithBrightPlace();
  const std::vector<SlicePlane> planes = PlanSlices(build.landmarks);
  ASSERT_EQ(planes.size(), 4U);
  // Left of the patient at the right of the picture, back at the bottom, head at the top; in the
  // sagittal slice the back at the right.
  const Picture axial = DrawSlice(build, planes[0]);
  EXPECT_LT((BrightPlace(axial) - Eigen::Vector2d(0.5, 0.5)).norm(), 0.05);
  EXPECT_EQ(axial.at_left + axial.at_right + axial.at_top + axial.at_bottom, "RLAP");
  for (const SlicePlane& coronal : {planes[1], planes[2]}) {
    const Picture picture = DrawSlice(build, coronal);
    EXPECT_LT((BrightPlace(picture) - Eigen::Vector2d(0.5, -0.45)).norm(), 0.05);
    EXPECT_EQ(picture.at_left + picture.at_right + picture.at_top + picture.at_bottom, "RLSI");
  }
  const Picture sagittal = DrawSlice(build, planes[3]);
  EXPECT_LT((BrightPlace(sagittal) - Eigen::Vector2d(0.5, -0.45)).norm(), 0.05);
  EXPECT_EQ(sagittal.at_left + sagittal.at_right + sagittal.at_top + sagittal.at_bottom, "APSI");
}

TEST(SlicePicturesTest, LabelsAreTintedWithinTheirOutline) {
  PlanBuild build = WithBrightPlace();
  for (int y = 8; y <= 12; ++y) {
    for (int x = 2; x <= 6; ++x) build.bone.At(x, y, 14) = kFirstSegment;
  }
  const Picture picture = DrawSlice(build, PlanSlices(build.landmarks)[0]);
  const auto colour_at = [&](double x_mm, double y_mm) {
    const auto column = static_cast<size_t>(x_mm / 40 * (picture.width - 1));
    const auto row = static_cast<size_t>(y_mm / 40 * (picture.height - 1));
    const uint8_t* pixel = &picture.rgb[3 * (row * picture.width + column)];
    return Colour(pixel[0] / 255.0, pixel[1] / 255.0, pixel[2] / 255.0);
  };
  EXPECT_LT((colour_at(8, 20) - 0.3 * SegmentColour(0)).norm(), 0.01);
  EXPECT_EQ(colour_at(20, 20), Colour::Zero());
  const auto full = [&](double x_mm) { return (colour_at(x_mm, 20) - SegmentColour(0)).norm(); };
  EXPECT_LT(std::min({full(2.8), full(3.0), full(3.2), full(3.4)}),
            0.01);  // between voxels 1 and 2
}

}  // namespace
}  // namespace tissueform
