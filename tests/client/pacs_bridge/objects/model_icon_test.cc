// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/model_icon.h"

#include <algorithm>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

constexpr int kSide = kIconPixels;

uint8_t At(const std::vector<uint8_t>& icon, int x, int y) {
  return icon[static_cast<size_t>(y * kSide + x)];
}

// Four corners in the plane of the face: 2 triangles.
FloatPositions Square(float left, float right, float low, float high) {
  FloatPositions corners(4, 3);
  corners << left, 0, low, right, 0, low, right, 0, high, left, 0, high;
  return corners;
}

TriangleIndices SquareTriangles() {
  TriangleIndices triangles(2, 3);
  triangles << 0, 1, 2, 0, 2, 3;
  return triangles;
}

TEST(ModelIcon, ASurfaceFillsTheMiddleAndLeavesABorder) {
  const auto icon = DrawModelIcon(Square(-50, 50, -50, 50), SquareTriangles(), {});
  ASSERT_EQ(icon.size(), static_cast<size_t>(kSide * kSide));
  EXPECT_GT(At(icon, kSide / 2, kSide / 2), 0);
  for (int i = 0; i < kSide; ++i) {
    EXPECT_EQ(At(icon, i, 0) + At(icon, i, kSide - 1), 0);
    EXPECT_EQ(At(icon, 0, i) + At(icon, kSide - 1, i), 0);
  }
}

TEST(ModelIcon, ThePatientsLeftIsOnTheRightAndTheTopAbove) {
  // A bar below, and a triangle above its end on the patient's left.
  FloatPositions positions(7, 3);
  positions.topRows(4) = Square(-50, 50, -50, -40);
  positions.bottomRows(3) << 40, 0, 40, 50, 0, 40, 50, 0, 50;
  TriangleIndices triangles(3, 3);
  triangles.topRows(2) = SquareTriangles();
  triangles.row(2) << 4, 5, 6;
  const auto icon = DrawModelIcon(positions, triangles, {});
  const auto count = [&](int x_from, int y_from) {
    int seen = 0;
    for (int y = y_from; y < y_from + kSide / 2; ++y) {
      for (int x = x_from; x < x_from + kSide / 2; ++x) seen += At(icon, x, y) > 0 ? 1 : 0;
    }
    return seen;
  };
  EXPECT_EQ(count(0, 0), 0);
  EXPECT_GT(count(kSide / 2, 0), 0);
  EXPECT_GT(count(0, kSide / 2), count(kSide / 2, 0));
}

TEST(ModelIcon, EmptyModelGivesABlackIcon) {
  const auto icon = DrawModelIcon(FloatPositions(0, 3), TriangleIndices(0, 3), {});
  EXPECT_EQ(*std::max_element(icon.begin(), icon.end()), 0);
}

TEST(ModelIcon, TrianglesWithoutAreaAreNotSeen) {
  FloatPositions positions = FloatPositions::Ones(4, 3);
  const auto icon = DrawModelIcon(positions, SquareTriangles(), {});
  EXPECT_EQ(*std::max_element(icon.begin(), icon.end()), 0);
}

}  // namespace
}  // namespace tissueform
