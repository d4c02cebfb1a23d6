// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/palette.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// CIELAB of an sRGB colour, white point D65, by the formulas of CIE 15 and IEC 61966-2-1.
Eigen::Vector3d ToLab(const Colour& colour) {
  const Eigen::Vector3d linear = colour.unaryExpr(
      [](double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); });
  Eigen::Matrix3d to_xyz;
  to_xyz << 0.4124564, 0.3575761, 0.1804375,  //
      0.2126729, 0.7151522, 0.0721750,        //
      0.0193339, 0.1191920, 0.9503041;
  const Eigen::Vector3d white(0.95047, 1, 1.08883);
  const Eigen::Vector3d f = (to_xyz * linear).cwiseQuotient(white).unaryExpr([](double t) {
    constexpr double kSmall = 6.0 / 29;
    return t > kSmall * kSmall * kSmall ? std::cbrt(t) : t / (3 * kSmall * kSmall) + 4.0 / 29;
  });
  return {116 * f.y() - 16, 500 * (f.x() - f.y()), 200 * (f.y() - f.z())};
}

std::vector<double> StepsOfLightness() {
  std::vector<double> steps;
  for (size_t c = 0; c + 1 < MapColours().size(); ++c) {
    steps.push_back(ToLab(MapColours()[c]).x() - ToLab(MapColours()[c + 1]).x());
  }
  return steps;
}

TEST(PaletteTest, LabOfWhiteAndRedIsAsInTheTables) {
  EXPECT_LT((ToLab({1, 1, 1}) - Eigen::Vector3d(100, 0, 0)).norm(), 0.02);
  EXPECT_LT((ToLab({1, 0, 0}) - Eigen::Vector3d(53.24, 80.09, 67.20)).norm(), 0.02);
}

TEST(PaletteTest, LightnessFallsAtEveryStepByAboutAsMuch) {
  const std::vector<double> steps = StepsOfLightness();
  const double mean = (ToLab(MapColours().front()).x() - ToLab(MapColours().back()).x()) /
                      static_cast<double>(steps.size());
  EXPECT_GT(mean, 3);
  EXPECT_GT(*std::min_element(steps.begin(), steps.end()), 0.8 * mean);
  EXPECT_LT(*std::max_element(steps.begin(), steps.end()), 1.25 * mean);
}

// 2.3 is a difference that is just noticed; a palette may be uneven in colour by a factor of two.
TEST(PaletteTest, NeighboursAreDistinctAndNoStepStandsOut) {
  double least = HUGE_VAL;
  double most = 0;
  for (size_t c = 0; c + 1 < MapColours().size(); ++c) {
    const double step = (ToLab(MapColours()[c]) - ToLab(MapColours()[c + 1])).norm();
    least = std::min(least, step);
    most = std::max(most, step);
  }
  EXPECT_GT(least, 2 * 2.3);
  EXPECT_LT(most, 2.5 * least);
}

// On white paper, and dark enough at the other end to be no grey of shading.
TEST(PaletteTest, BothEndsAreSeen) {
  EXPECT_LT(ToLab(MapColours().front()).x(), 92);
  EXPECT_GT(ToLab(MapColours().back()).x(), 12);
}

}  // namespace
}  // namespace tissueform
