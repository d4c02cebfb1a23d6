// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/handle_words.h"

#include <cmath>
#include <memory>

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

// Words for the pose of the handle "top" of a bar.
std::string WordsOf(const HandlePose& pose) {
  return MovesInWords({.mesh = nullptr,
                       .point_data = {},
                       .cell_data = {},
                       .written_in = CoordinateSystem::kLps,
                       .stiffness = {},
                       .constraints = BarEnds(Bar({1, 1, 2})),
                       .poses = {pose},
                       .deformer = {},
                       .uncertainty = {}});
}

std::string WordsOfMove(double x, double y, double z) {
  HandlePose pose;
  pose.translation_mm = {x, y, z};
  return WordsOf(pose);
}

TEST(HandleWordsTest, MovesAlongAnAxisAreNamedForThePatient) {
  EXPECT_EQ(WordsOfMove(0, -8, 0), "top 8 mm forward");
  EXPECT_EQ(WordsOfMove(0, 2.5, 0), "top 2.5 mm back");
  EXPECT_EQ(WordsOfMove(3, 0, 0), "top 3 mm to the left");
  EXPECT_EQ(WordsOfMove(-3, 0, 0), "top 3 mm to the right");
  EXPECT_EQ(WordsOfMove(0, 0, 5), "top 5 mm up");
  EXPECT_EQ(WordsOfMove(0.01, 0, -5), "top 5 mm down");
}

TEST(HandleWordsTest, MovesBetweenAxesHaveNoDirection) {
  EXPECT_EQ(WordsOfMove(3, 4, 0), "top 5 mm");
}

TEST(HandleWordsTest, TurnsAreInDegreesAndRestIsStated) {
  HandlePose pose;
  EXPECT_EQ(WordsOf(pose), "top at rest");
  pose.rotation_vector = {0, 0, M_PI / 9};
  EXPECT_EQ(WordsOf(pose), "top turned by 20 degrees");
  pose.translation_mm = {0, -1, 0};
  pose.scale = 1.5;
  EXPECT_EQ(WordsOf(pose), "top 1 mm forward, turned by 20 degrees, scaled by 1.5");
}

}  // namespace
}  // namespace tissueform::testing
