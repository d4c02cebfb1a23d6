// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/mouth_report.h"

#include "absl/status/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

// LPS: looks towards -y, with the middle of the teeth at (5, 6, 7).
Landmarks UprightHead() {
  Landmarks landmarks;
  landmarks.midsagittal = {{5, 6, 7}, Eigen::Vector3d::UnitX()};
  landmarks.upper_teeth = {{5, 6, 7}, Eigen::Vector3d::UnitZ()};
  return landmarks;
}

// Seen from the right corner at -2 to the midline; the left one, at +1, is unsure.
MouthLine HalfSeenLine() {
  MouthLine line;
  for (int left = -2; left <= 1; ++left) {
    line.points.push_back(
        {.at = {static_cast<double>(left), 10, 1}, .notch_mm = left > 0 ? 0.0 : 3.0});
  }
  line.left_corner = MouthCornerReason::kNoNotch;
  line.seen_share = 0.75;
  return line;
}

TEST(MouthReportTest, PointsArePlacesOfTheCt) {
  const nlohmann::ordered_json json = MouthJson(HalfSeenLine(), UprightHead());
  EXPECT_EQ(json["found"], true);
  EXPECT_EQ(json["sure"], false);
  EXPECT_EQ(json["says"].size(), 3U);
  ASSERT_EQ(json["points_mm"].size(), 4U);
  EXPECT_EQ(json["points_mm"][0], nlohmann::ordered_json({3.0, -4.0, 8.0}));
  EXPECT_EQ(json["right_corner"]["at_mm"], nlohmann::ordered_json({3.0, -4.0, 8.0}));
  EXPECT_EQ(json["right_corner"]["from_midline_mm"], 2);
  EXPECT_EQ(json["right_corner"]["sure"], true);
  EXPECT_EQ(json["left_corner"]["sure"], false);
}

TEST(MouthReportTest, AnErrorIsReported) {
  const nlohmann::ordered_json json =
      MouthJson(absl::InvalidArgumentError("the skin is not in view"), UprightHead());
  EXPECT_EQ(json["found"], false);
  ASSERT_TRUE(json["says"].is_array());
  EXPECT_THAT(json["says"][0].get<std::string>(), HasSubstr("the skin is not in view"));
}

// Colors of an unsure corner are those of a point that is not seen.
TEST(MouthReportTest, TheSceneHoldsTheLineBeforeTheSkinAboutTheMouth) {
  SkinCoverage coverage;
  coverage.positions = Positions{{5, -6, 8}, {6, -4, 8}, {5, -4, 9}, {5, -4, 80}};
  coverage.triangles = TriangleIndices{{0, 1, 2}, {3, 1, 2}};
  const std::vector<Scene> scenes = MouthScenes(coverage, UprightHead(), HalfSeenLine());
  ASSERT_EQ(scenes.size(), 2U);
  EXPECT_LT((scenes[0].view.from - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12);
  EXPECT_LT((scenes[0].view.up - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  const std::vector<SurfaceLayer>& layers = scenes[0].surfaces;
  ASSERT_EQ(layers.size(), 5U);  // seen, not seen, the corners, the skin
  EXPECT_EQ(layers[0].triangles.rows(), 3 * 8);
  EXPECT_EQ(layers[1].triangles.rows(), 1 * 8);
  EXPECT_EQ(layers[2].colour, layers[0].colour);
  EXPECT_EQ(layers[3].colour, layers[1].colour);
  EXPECT_EQ(layers[4].triangles.rows(), 1);
  EXPECT_EQ(layers[4].positions.rows(), 3);
  // Hair stands 2 mm before the point at the midline, and its marker before it.
  EXPECT_NEAR(layers[0].positions.bottomRows(6).col(1).mean(), -6.5, 1e-12);
  EXPECT_NEAR(layers[0].positions.topRows(6).col(1).mean(), -4.5, 1e-12);
  EXPECT_EQ(MouthLegend().size(), 2U);
}

}  // namespace
}  // namespace tissueform
