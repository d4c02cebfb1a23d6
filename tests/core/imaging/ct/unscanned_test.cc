// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/unscanned.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

constexpr int kSize = 80;
constexpr int kSlices = 3;
constexpr int kMiddle = kSize / 2;

using Painter = std::function<double(double x, double y)>;  // from the middle, in pixels

CtVolume Painted(const Painter& painter) {
  CtVolume volume;
  volume.size = {kSize, kSize, kSlices};
  for (int k = 0; k < kSlices; ++k) {
    for (int j = 0; j < kSize; ++j) {
      for (int i = 0; i < kSize; ++i) {
        const double hu = painter(i - kMiddle, j - kMiddle);
        volume.hu.push_back(static_cast<int16_t>(std::lround(std::max(hu, -1024.0))));
      }
    }
  }
  return volume;
}

bool InCircle(double x, double y) { return std::hypot(x, y) < 36; }
// A blurred disc of tissue whose front lies beyond the circle.
double Head(double x, double y) {
  const double depth = 20 - std::hypot(x, y + 20);
  return -1000 + 1040 * std::clamp(depth / 2 + 0.5, 0.0, 1.0);
}

class UnscannedTest : public ::testing::Test {
 protected:
  double Noisy(double hu) { return hu + noise_(random_); }

  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0, 8};
};

TEST_F(UnscannedTest, OutsideOfTheCircleIsUnscanned) {
  for (const double fill : {-1024.0, -1000.0}) {
    const CtVolume volume =
        Painted([&](double x, double y) { return InCircle(x, y) ? Noisy(Head(x, y)) : fill; });
    const std::vector<uint8_t> unscanned = FindUnscanned(volume, 2);
    ASSERT_EQ(unscanned.size(), volume.hu.size());
    for (int j = 0; j < kSize; ++j) {
      for (int i = 0; i < kSize; ++i) {
        const double x = i - kMiddle;
        const double y = j - kMiddle;
        const bool found = unscanned[static_cast<size_t>(i + kSize * j)] != 0;
        if (!InCircle(x, y)) {
          EXPECT_TRUE(found) << x << " " << y;
        }
        if (std::hypot(x, y) < 32) {
          EXPECT_FALSE(found) << x << " " << y;
        }
        if (InCircle(x, y) && Head(x, y) > 0) {
          EXPECT_FALSE(found) << "tissue at " << x << " " << y;
        }
      }
    }
  }
}

// Two scans that were laid upon each other: a circle filled with -1023 in one with -1024, and an
// edge of two pixels between, as in one real CT.
TEST_F(UnscannedTest, TwoFillingsAreOne) {
  const CtVolume volume = Painted([&](double x, double y) {
    const double inner = std::hypot(x, y - 8);
    if (!InCircle(x, y)) return -1024.0;
    return inner < 35 ? Noisy(Head(x, y)) : inner < 36 ? -1014.0 : inner < 37 ? -1024.0 : -1023.0;
  });
  const std::vector<uint8_t> unscanned = FindUnscanned(volume, 1);
  ASSERT_FALSE(unscanned.empty());
  EXPECT_EQ(unscanned[kMiddle + kSize * 6], 1);  // between both circles
  EXPECT_EQ(unscanned[kMiddle + kSize * 10], 1);
  EXPECT_EQ(unscanned[kMiddle + kSize * 12], 1);  // its edge
  EXPECT_EQ(unscanned[kMiddle + kSize * 14], 0);  // tissue behind the inner one
}

TEST_F(UnscannedTest, DoesNotReportACircleThatCutsNoTissue) {
  const CtVolume volume = Painted(
      [&](double x, double y) { return InCircle(x, y) ? Noisy(Head(x, y - 10)) : -1024.0; });
  EXPECT_TRUE(FindUnscanned(volume, 1).empty());
}

TEST_F(UnscannedTest, AirThatWasCutOffAtTheLowestHuIsAir) {
  const CtVolume volume =
      Painted([](double x, double y) { return Head(x, y) > -990 ? Head(x, y) : -1024; });
  EXPECT_TRUE(FindUnscanned(volume, 1).empty());
}

// Programs that part a head from all else leave a sharp edge all round.
TEST_F(UnscannedTest, AHeadWithoutItsBackgroundIsNotCutAllRound) {
  const CtVolume volume =
      Painted([&](double x, double y) { return Head(x, y) > 0 ? Noisy(Head(x, y)) : -1024.0; });
  EXPECT_TRUE(FindUnscanned(volume, 1).empty());
}

constexpr int kMetalSlice = 4;

// Nine slices, 2 mm apart, of which the fifth has metal in the middle.
struct WithMetal {
  CtVolume volume;
  std::vector<uint8_t> metal;
};
WithMetal PaintedWithMetal(const std::function<double(double x, double y, int k)>& painter) {
  WithMetal ct;
  for (int k = 0; k < 9; ++k) {
    const CtVolume slice = Painted([&](double x, double y) { return painter(x, y, k); });
    ct.volume.hu.insert(ct.volume.hu.end(), slice.hu.begin(),
                        slice.hu.begin() + std::ptrdiff_t{kSize} * kSize);
  }
  ct.volume.size = {kSize, kSize, 9};
  ct.volume.spacing_mm[2] = 2;
  ct.metal.assign(ct.volume.hu.size(), 0);
  ct.metal[static_cast<size_t>(kMiddle + kSize * (kMiddle + kSize * kMetalSlice))] = 1;
  return ct;
}

// From the head's front to the circle.
bool InStreak(double x, double y, int k) {
  return std::abs(k - kMetalSlice) < 2 && std::abs(x) < 4 && y < -10;
}

TEST_F(UnscannedTest, DarkStreaksOfMetalAreNotTheCircle) {
  const WithMetal ct = PaintedWithMetal([&](double x, double y, int k) {
    const double head = Head(x, y - 14);
    if (!InCircle(x, y) || (InStreak(x, y, k) && head < 0)) return -1024.0;
    return Noisy(head);
  });
  EXPECT_FALSE(FindUnscanned(ct.volume, 2).empty());
  EXPECT_TRUE(FindUnscanned(ct.volume, 2, ct.metal).empty());
}

TEST_F(UnscannedTest, CircleStillCutsNextToAStreak) {
  const auto cut_head = [&](double x, double y, int k) {
    const bool streak = std::abs(k - kMetalSlice) < 2 && std::abs(y + 5) < 4 && x > 10;
    const double head = Head(x, y);
    if (!InCircle(x, y) || (streak && head < 0)) return -1024.0;
    return Noisy(head);
  };
  const WithMetal ct = PaintedWithMetal(cut_head);
  const std::vector<uint8_t> all = FindUnscanned(ct.volume, 2);
  const std::vector<uint8_t> found = FindUnscanned(ct.volume, 2, ct.metal);
  ASSERT_EQ(found.size(), all.size());
  const auto at = [](int x, int y) {
    return static_cast<size_t>(x + kMiddle + kSize * (y + kMiddle + kSize * kMetalSlice));
  };
  EXPECT_EQ(all[at(25, -5)], 1);  // in the streak
  EXPECT_EQ(found[at(25, -5)], 0);
  for (const auto& [x, y] : {std::pair(0, -37), std::pair(0, 38), std::pair(37, -5)}) {
    EXPECT_EQ(found[at(x, y)], 1) << x << " " << y;
  }
  const auto clean = static_cast<std::ptrdiff_t>(kSize) * kSize;
  EXPECT_TRUE(std::equal(found.begin(), found.begin() + clean, all.begin()));
}

TEST_F(UnscannedTest, OnTheGridItEndsWhereTheTissueDoes) {
  const CtVolume volume =
      Painted([&](double x, double y) { return InCircle(x, y) ? Noisy(Head(x, y)) : -1024.0; });
  for (const double spacing_mm : {1.0, 2.0}) {
    ASSERT_OK_AND_ASSIGN(const LabelGrid unscanned, ResampleUnscanned(volume, spacing_mm, 2));
    ASSERT_FALSE(unscanned.values.empty());
    const GridGeometry& grid = unscanned.geometry;
    for (int y = 0; y < grid.size[1] / 2; ++y) {
      const Eigen::Vector3d place = grid.Centre(grid.size[0] / 2, y, 0);
      const double from_middle = kMiddle - place.y();
      if (from_middle > 36 + spacing_mm) {
        EXPECT_EQ(unscanned.At(grid.size[0] / 2, y, 0), 1);
      }
      if (from_middle < 36 - spacing_mm) {
        EXPECT_EQ(unscanned.At(grid.size[0] / 2, y, 0), 0);
      }
    }
  }
}

TEST_F(UnscannedTest, CornersAroundASlantedVolumeAreUnscanned) {
  CtVolume volume = Painted([&](double x, double y) { return Noisy(Head(x, y)); });
  ASSERT_OK_AND_ASSIGN(const LabelGrid upright, ResampleUnscanned(volume, 2, 1));
  EXPECT_TRUE(upright.values.empty());
  volume.direction.col(1) = Eigen::Vector3d(0, std::cos(0.3), -std::sin(0.3));
  ASSERT_OK_AND_ASSIGN(const LabelGrid slanted, ResampleUnscanned(volume, 2, 1));
  ASSERT_FALSE(slanted.values.empty());
  EXPECT_EQ(slanted.At(0, 0, 0), 1);
  const auto& size = slanted.geometry.size;
  EXPECT_EQ(slanted.At(size[0] / 2, size[1] / 2, size[2] / 2), 0);
}

}  // namespace
}  // namespace tissueform
