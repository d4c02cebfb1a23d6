// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/metal_detection.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

constexpr int kSize = 64;
constexpr int kSlices = 24;
const Eigen::Vector3d kTooth(10, -6, 11);  // mm, LPS; the head's middle is 0, 0

// A head of muscle with noise of 20 HU, in voxels of 1 x 1 x 1.5 mm from z = -6 on, with a tooth
// whose density is given at every distance from its middle, in voxels, up to 4.
CtVolume HeadWithTooth(const std::function<double(double)>& tooth_hu) {
  CtVolume volume;
  volume.size = {kSize, kSize, kSlices};
  volume.spacing_mm = {1, 1, 1.5};
  volume.origin_mm = {-kSize / 2.0, -kSize / 2.0, -6};
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 20);
  for (int k = 0; k < kSlices; ++k) {
    for (int j = 0; j < kSize; ++j) {
      for (int i = 0; i < kSize; ++i) {
        const Eigen::Vector3d place =
            volume.origin_mm + volume.StepsMm() * Eigen::Vector3d(i, j, k);
        double hu = std::hypot(place.x(), place.y()) < 28 ? 50 : -1000;
        const double from_tooth = (place - kTooth).cwiseQuotient(volume.spacing_mm).norm();
        if (from_tooth < 4) hu = tooth_hu(from_tooth);
        volume.hu.push_back(
            static_cast<int16_t>(std::lround(hu + (hu > 2000 ? 0 : noise(random)))));
      }
    }
  }
  return volume;
}

// Dark and bright rays about the tooth.
void AddStreaks(CtVolume* volume) {
  for (int k = 8; k < 16; ++k) {
    for (int j = 0; j < kSize; ++j) {
      for (int i = 0; i < kSize; ++i) {
        const Eigen::Vector3d place =
            volume->origin_mm + volume->StepsMm() * Eigen::Vector3d(i, j, k) - kTooth;
        const double angle = std::atan2(place.y(), place.x());
        int16_t& hu = volume->hu[static_cast<size_t>(i + kSize * (j + kSize * k))];
        if (hu < 300 && hu > -300) hu = static_cast<int16_t>(hu + 150 * std::sin(12 * angle));
      }
    }
  }
}

// Rises to the middle, no two shells alike: nothing is cut off at a highest value.
double Enamel(double from_middle) { return 3080 - 70 * from_middle; }

TEST(MetalDetectionTest, EnamelIsNotMetal) {
  EXPECT_FALSE(FindMetal(HeadWithTooth(Enamel)).any());
  EXPECT_TRUE(FindMetal(HeadWithTooth(Enamel)).mask.empty());
}

TEST(MetalDetectionTest, VoxelsAtTheEndOfTheScannersScaleAreMetal) {
  const MetalFindings findings = FindMetal(HeadWithTooth([](double) { return 3071.0; }));
  ASSERT_EQ(findings.clusters.size(), 1U);
  EXPECT_NEAR(findings.clusters[0].volume_mm3, 4.0 / 3 * std::numbers::pi * 64 * 1.5, 15);
  EXPECT_LT((findings.clusters[0].centre_mm - kTooth).norm(), 0.8);
  EXPECT_EQ(findings.clusters[0].top_hu, 3071);
  EXPECT_NEAR(findings.clusters[0].high_z_mm - findings.clusters[0].low_z_mm, 9, 1.6);
}

TEST(MetalDetectionTest, AnExtendedScaleShowsMetalByItsDensity) {
  const MetalFindings findings =
      FindMetal(HeadWithTooth([](double r) { return 20000 - 2000 * r; }));
  EXPECT_EQ(findings.clusters.size(), 1U);
}

TEST(MetalDetectionTest, StreaksDistinguishMetalFromEnamelOfTheSameDensity) {
  CtVolume volume = HeadWithTooth(Enamel);
  AddStreaks(&volume);
  EXPECT_TRUE(FindMetal(volume).any());
}

TEST(MetalDetectionTest, DeadVoxelsInsideCountAsMetal) {
  const CtVolume volume = HeadWithTooth([](double r) { return r < 1.6 ? -1024.0 : 3071.0; });
  const MetalFindings findings = FindMetal(volume);
  ASSERT_TRUE(findings.any());
  const int i = static_cast<int>(kTooth.x()) + kSize / 2;
  const int j = static_cast<int>(kTooth.y()) + kSize / 2;
  const int k = static_cast<int>((kTooth.z() + 6) / 1.5);
  const auto index = static_cast<size_t>(i + kSize * (j + kSize * k));
  ASSERT_LT(volume.hu[index], 0);
  EXPECT_EQ(findings.mask[index], 1);
}

// Air that metal only half surrounds stays air.
TEST(MetalDetectionTest, AnOpenGapIsNotFilled) {
  CtVolume volume = HeadWithTooth([](double r) { return r < 1.6 ? -1000.0 : 3071.0; });
  const int j = static_cast<int>(kTooth.y()) + kSize / 2;
  for (int k = 0; k < kSlices; ++k) {
    for (int i = kSize / 2 + static_cast<int>(kTooth.x()); i < kSize; ++i) {
      volume.hu[static_cast<size_t>(i + kSize * (j + kSize * k))] = -1000;
    }
  }
  const MetalFindings findings = FindMetal(volume);
  ASSERT_TRUE(findings.any());
  for (size_t index = 0; index < volume.hu.size(); ++index) {
    if (volume.hu[index] < -900) {
      ASSERT_EQ(findings.mask[index], 0);
    }
  }
}

TEST(MetalDetectionTest, AGivenThresholdDecidesAlone) {
  const CtVolume volume = HeadWithTooth([](double) { return 2200.0; });
  EXPECT_FALSE(FindMetal(volume).any());
  EXPECT_TRUE(FindMetal(volume, 2000).any());
  EXPECT_FALSE(FindMetal(HeadWithTooth([](double) { return 3071.0; }), 3100).any());
}

TEST(MetalDetectionTest, SlicesMayLieAlongAnyAxisOfTheFile) {
  const CtVolume upright = HeadWithTooth([](double r) { return r < 1.6 ? -1024.0 : 3071.0; });
  CtVolume turned = upright;  // the file's first axis is the patient's third
  turned.size = {kSlices, kSize, kSize};
  turned.spacing_mm = {1.5, 1, 1};
  turned.direction << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  size_t at = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      for (int z = 0; z < kSlices; ++z) turned.hu[at++] = upright.At(x, y, z);
    }
  }
  const MetalFindings a = FindMetal(upright);
  const MetalFindings b = FindMetal(turned);
  ASSERT_EQ(a.clusters.size(), b.clusters.size());
  EXPECT_LT((a.clusters[0].centre_mm - b.clusters[0].centre_mm).norm(), 1e-9);
  for (int z = 0; z < kSlices; ++z) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        ASSERT_EQ(a.mask[static_cast<size_t>(x + kSize * (y + kSize * z))],
                  b.mask[static_cast<size_t>(z + kSlices * (x + kSize * y))]);
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
