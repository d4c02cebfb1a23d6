// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/carried_skin.h"

#include <cmath>
#include <cstdlib>
#include <functional>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

constexpr int kSide = 80;
constexpr int kSlices = 12;
constexpr int kTorn = 6;  // the slice with metal

double RadiusMm(int i, int j) { return std::hypot(i - 40, j - 40); }

// A cone of tissue in air, 26 to 30 mm in radius, in voxels of 1 x 1 x 2 mm, with a piece of metal
// in one slice, where `streak(i, j)` gives the HU, or 0 without a streak.
struct Head {
  CtVolume volume;
  MetalFindings findings;

  explicit Head(const std::function<int(int, int)>& streak) {
    volume.size = {kSide, kSide, kSlices};
    volume.spacing_mm = {1, 1, 2};
    for (int k = 0; k < kSlices; ++k) {
      for (int j = 0; j < kSide; ++j) {
        for (int i = 0; i < kSide; ++i) {
          const bool inside = RadiusMm(i, j) < 26 + 4.0 * k / kSlices;
          const int hu = k == kTorn ? streak(i, j) : 0;
          volume.hu.push_back(static_cast<int16_t>(hu != 0 ? hu : inside ? 50 : -1000));
        }
      }
    }
    findings.mask.assign(volume.hu.size(), 0);
    findings.mask[Index(40, 40)] = 1;
    findings.clusters.emplace_back();
    volume.hu[Index(40, 40)] = 3500;
  }
  static size_t Index(int i, int j) { return static_cast<size_t>(i + kSide * (j + kSide * kTorn)); }
};

TEST(CarriedSkinTest, ADarkNotchIsFilled) {
  Head head([](int i, int j) { return j < 38 && std::abs(i - 40) < 3 ? -1000 : 0; });
  const CarriedSkin carried = CarrySkinOver(head.findings, 2, &head.volume);
  EXPECT_EQ(carried.slices, 1);
  EXPECT_GE(carried.filled_mm3, 5 * 14 * 2);
  EXPECT_EQ(carried.removed_mm3, 0);
  EXPECT_GT(head.volume.At(40, 40 - 24, kTorn), 0);
  EXPECT_EQ(carried.mask[Head::Index(40, 40 - 24)], 1);
  // Deeper than 15 mm, and before the skin, it stays.
  EXPECT_EQ(head.volume.At(40, 37, kTorn), -1000);
  EXPECT_LT(head.volume.At(40, 40 - 31, kTorn), -900);
}

TEST(CarriedSkinTest, BrightRidgesAreRemoved) {
  Head head([](int i, int j) { return i != 40 && std::abs(j - 40) < 4 ? 400 : 0; });
  const CarriedSkin carried = CarrySkinOver(head.findings, 2, &head.volume);
  EXPECT_EQ(carried.slices, 1);
  EXPECT_EQ(carried.filled_mm3, 0);
  EXPECT_GT(carried.removed_mm3, 2 * 7 * 8 * 2);
  EXPECT_EQ(head.volume.At(75, 40, kTorn), -1000);
  EXPECT_EQ(head.volume.At(5, 40, kTorn), -1000);
  EXPECT_EQ(head.volume.At(60, 40, kTorn), 400);
}

// A ridge that changes the outline no more than the head does from slice to slice does not count.
TEST(CarriedSkinTest, SkinThatIsNotTornStaysBitwise) {
  Head head([](int i, int j) { return i > 40 && i < 70 && std::abs(j - 40) < 2 ? 400 : 0; });
  const std::vector<int16_t> before = head.volume.hu;
  const CarriedSkin carried = CarrySkinOver(head.findings, 1, &head.volume);
  EXPECT_EQ(carried.slices, 0);
  EXPECT_TRUE(carried.mask.empty());
  EXPECT_EQ(head.volume.hu, before);
}

// Lips bulge in a few slices, and a mouth is open: both are wider than a streak.
TEST(CarriedSkinTest, WideBulgesAndWideOpeningsStay) {
  for (const bool bulge : {true, false}) {
    Head head([bulge](int i, int j) {
      const double radius = RadiusMm(i, j);
      const bool front = j < 40 && std::abs(i - 40) < 14;
      if (bulge) return front && radius >= 27 && radius < 31 ? 50 : 0;
      return front && radius > 18 && radius < 30 ? -1000 : 0;
    });
    CarrySkinOver(head.findings, 1, &head.volume);
    EXPECT_EQ(head.volume.At(40, 40 - (bulge ? 29 : 22), kTorn), bulge ? 50 : -1000);
  }
}

TEST(CarriedSkinTest, SoundSlicesStayBitwise) {
  Head head([](int, int) { return 0; });
  const std::vector<int16_t> before = head.volume.hu;
  const CarriedSkin carried = CarrySkinOver(head.findings, 2, &head.volume);
  EXPECT_EQ(carried.slices, 0);
  EXPECT_TRUE(carried.mask.empty());
  EXPECT_EQ(head.volume.hu, before);
}

TEST(CarriedSkinTest, DoesNotDependOnThreads) {
  const auto streak = [](int i, int j) { return i > 40 && std::abs(j - 40) < 3 ? 400 : 0; };
  Head one(streak);
  Head two(streak);
  CarrySkinOver(one.findings, 1, &one.volume);
  CarrySkinOver(two.findings, 3, &two.volume);
  EXPECT_EQ(one.volume.hu, two.volume.hu);
}

}  // namespace
}  // namespace tissueform
