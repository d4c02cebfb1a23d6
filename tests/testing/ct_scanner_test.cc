// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/ct_scanner.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/metal_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

constexpr int kSize = 200;
constexpr double kPixelMm = 1;

double RadiusOf(int x, int y, double centre_x_mm = 0, double centre_y_mm = 0) {
  const double middle = 0.5 * (kSize - 1);
  return std::hypot((x - middle) * kPixelMm - centre_x_mm, (y - middle) * kPixelMm - centre_y_mm);
}

// A disc of one value in air, its edge as smooth as pixels are.
std::vector<int16_t> Disc(double radius_mm, int hu) {
  std::vector<int16_t> values;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double inside = std::clamp(radius_mm - RadiusOf(x, y) + 0.5, 0.0, 1.0);
      values.push_back(static_cast<int16_t>(std::lround(-1000 + inside * (hu + 1000))));
    }
  }
  return values;
}

struct MeanAndDeviation {
  double mean = 0;
  double deviation = 0;
};

MeanAndDeviation Of(const std::vector<int16_t>& hu, double radius_mm, double x_mm = 0,
                    double y_mm = 0) {
  double sum = 0;
  double squares = 0;
  int count = 0;
  for (int i = 0; i < kSize * kSize; ++i) {
    if (RadiusOf(i % kSize, i / kSize, x_mm, y_mm) > radius_mm) continue;
    const double value = hu[static_cast<size_t>(i)];
    sum += value;
    squares += value * value;
    ++count;
  }
  const double mean = sum / count;
  return {mean, std::sqrt(squares / count - mean * mean)};
}

std::vector<MetalCell> MetalDisc(double radius_mm, double x_mm, double y_mm) {
  constexpr double kStep = 0.1;
  std::vector<MetalCell> cells;
  const int steps = static_cast<int>(radius_mm / kStep);
  for (int i = -steps; i <= steps; ++i) {
    for (int j = -steps; j <= steps; ++j) {
      const double x = kStep * j;
      const double y = kStep * i;
      if (std::hypot(x, y) > radius_mm) continue;
      cells.push_back({static_cast<float>(x_mm + x), static_cast<float>(y_mm + y), kStep * kStep});
    }
  }
  return cells;
}

std::vector<int16_t> Scan(const CtScanner& scanner, const std::vector<int16_t>& hu,
                          const MetalLayers& layers = {}) {
  const TissueSlice slice = TissueOfHu(hu.data(), kSize, kPixelMm);
  const TissueLengths lengths = scanner.ProjectTissue(slice);
  Eigen::ArrayXXf transmission = scanner.Transmission(lengths);
  if (!layers.empty()) {
    transmission = scanner.WithMetal(transmission, slice, lengths, Metal::kSteel, layers);
  }
  return scanner.Reconstruct(scanner.Measure(transmission, 1), kSize, kPixelMm);
}

TEST(CtScannerTest, LinesThroughADiscAreAsLongAsItsChords) {
  const ScannerOptions options;
  const CtScanner scanner(options);
  constexpr double kRadius = 70;
  const std::vector<int16_t> hu = Disc(kRadius, 0);
  const TissueLengths lengths = scanner.ProjectTissue(TissueOfHu(hu.data(), kSize, kPixelMm));
  for (int view = 0; view < options.num_views; view += 37) {
    for (int channel = 0; channel < options.num_channels; channel += 11) {
      const double u = (channel - 0.5 * (options.num_channels - 1)) * options.channel_mm;
      const double from_axis = options.source_mm * std::abs(u) / std::hypot(options.source_mm, u);
      const double inside = std::max(0.0, kRadius * kRadius - from_axis * from_axis);
      if (std::abs(kRadius - from_axis) < 4) continue;  // where a pixel is a large part of it
      EXPECT_NEAR(lengths.water(channel, view), 2 * std::sqrt(inside), 0.7) << view << " " << u;
      EXPECT_EQ(lengths.bone(channel, view), 0);
    }
  }
}

// A pin beside the axis: its shadow lies where the ray from the source through it says, and is as
// long as its diameter.
TEST(CtScannerTest, ShadowOfAPinLiesWhereItsRayGoes) {
  const ScannerOptions options;
  const CtScanner scanner(options);
  const Eigen::ArrayXXf lengths = scanner.ProjectMetal(MetalDisc(3, 40, -25));
  for (int view = 0; view < options.num_views; view += 41) {
    const double angle = 2 * std::numbers::pi * view / options.num_views;
    const Eigen::Vector2d source =
        options.source_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const Eigen::Vector2d across(-std::sin(angle), std::cos(angle));
    const Eigen::Vector2d ray = Eigen::Vector2d(40, -25) - source;
    const double u_mm = options.source_mm * ray.dot(across) / -ray.dot(source.normalized());
    const Eigen::ArrayXf shadow = lengths.col(view);
    EXPECT_NEAR(shadow.maxCoeff(), 6, 0.3);
    double centre = 0;
    for (int c = 0; c < options.num_channels; ++c) {
      centre += shadow[c] * (c - 0.5 * (options.num_channels - 1)) * options.channel_mm;
    }
    EXPECT_NEAR(centre / shadow.sum(), u_mm, 0.05);
  }
}

TEST(CtScannerTest, WaterComesBackAsZero) {
  const CtScanner scanner;
  const std::vector<int16_t> hu = Scan(scanner, Disc(85, 0));
  for (const double x_mm : {0.0, 35.0, -60.0}) {
    const MeanAndDeviation part = Of(hu, 12, x_mm);
    EXPECT_NEAR(part.mean, 0, 4) << x_mm;  // no cup: its beam hardening is corrected
    EXPECT_GT(part.deviation, 2);
    EXPECT_LT(part.deviation, 30);
  }
  EXPECT_NEAR(Of(hu, 5, 95).mean, -1000, 5);
}

TEST(CtScannerTest, BoneComesBackWithinItsBeamHardening) {
  std::vector<int16_t> hu = Disc(85, 40);
  for (int i = 0; i < kSize * kSize; ++i) {
    if (RadiusOf(i % kSize, i / kSize, 40) < 8) hu[static_cast<size_t>(i)] = 1200;
  }
  const std::vector<int16_t> scanned = Scan(CtScanner(), hu);
  EXPECT_NEAR(Of(scanned, 5, 40).mean, 1200, 150);
  EXPECT_NEAR(Of(scanned, 10, -40).mean, 40, 15);
}

TEST(CtScannerTest, MetalIsClippedAndDarkensTheTissueBetween) {
  const CtScanner scanner;
  const std::vector<int16_t> water = Disc(85, 0);
  std::vector<MetalCell> pins = MetalDisc(3, -25, 0);
  const std::vector<MetalCell> other = MetalDisc(3, 25, 0);
  pins.insert(pins.end(), other.begin(), other.end());
  const std::vector<int16_t> hu = Scan(scanner, water, {pins});
  EXPECT_EQ(Of(hu, 1, 25).mean, 3071);
  EXPECT_LT(Of(hu, 2, 0).mean, -150);
  EXPECT_NEAR(Of(hu, 10, 0, 60).mean, 0, 40);  // far from the line through both
  const std::vector<int16_t> free = Scan(scanner, water);
  EXPECT_GT(Of(hu, 10, 0, 20).deviation, 2 * Of(free, 10, 0, 20).deviation);
}

TEST(CtScannerTest, NoiseIsThatOfTheSeed) {
  const CtScanner scanner;
  const TissueLengths lengths{Eigen::ArrayXXf::Constant(512, 4, 200),
                              Eigen::ArrayXXf::Zero(512, 4)};
  const Eigen::ArrayXXf transmission = scanner.Transmission(lengths);
  const Eigen::ArrayXXf one = scanner.Measure(transmission, 1);
  EXPECT_TRUE((one == scanner.Measure(transmission, 1)).all());
  EXPECT_FALSE((one == scanner.Measure(transmission, 2)).all());
  EXPECT_NEAR(one.mean(), 200, 0.5);
}

double AreaOf(const MetalLayers& layers) {
  double area = 0;
  for (const std::vector<MetalCell>& cells : layers) {
    for (const MetalCell& cell : cells) area += cell.area_mm2;
  }
  return area / static_cast<double>(layers.size());
}

// Volumes of bodies, by hand.
TEST(MetalPhantomTest, PartsFillTheirVolume) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, FineHead());
  const Eigen::Vector3d place(-90.03, 60.07, -75.2);
  const double slice_mm = head.spacing_mm.z();
  MetalPart part{.shape = MetalShape::kBox, .centre_mm = place, .half_mm = {1.5, 1, 1.5}};
  const auto volume = [&] {
    double sum = 0;
    for (int k = 0; k < head.size[2]; ++k) {
      const MetalLayers layers = LayersOf({.metal = Metal::kSteel, .parts = {part}}, head, k);
      if (!layers.empty()) sum += AreaOf(layers) * slice_mm;
    }
    return sum;
  };
  EXPECT_NEAR(volume(), 18, 1.5);
  part.shape = MetalShape::kEllipsoid;
  part.half_mm = {2.5, 2, 1.6};
  EXPECT_NEAR(volume(), 4.0 / 3 * std::numbers::pi * 8, 1.5);
  part.shape = MetalShape::kRod;
  part.half_mm = {10, 0.25, 0.25};
  EXPECT_NEAR(volume(), std::numbers::pi * 0.0625 * 20, 0.5);
}

TEST(MetalPhantomTest, FineHeadLiesWhereTheCoarseOneDoes) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, FineHead());
  EXPECT_NEAR(head.spacing_mm.x(), 0.8, 1e-12);
  // The first coarse pixel's outer edge is the first fine one's.
  EXPECT_NEAR(std::abs(head.origin_mm.y()), 1.2, 1e-9);
  EXPECT_NEAR(head.origin_mm.x(), 1.2, 1e-9);
}

TEST(MetalPhantomTest, OnlyMetalDiffersWhateverTheThreads) {
  // One slice with fillings only, one with braces only, one with both.
  const std::vector<int> slices = {54, 58, 70};
  ASSERT_OK_AND_ASSIGN(const SimulatedHeads one, SimulateHeads(1, slices));
  ASSERT_OK_AND_ASSIGN(const SimulatedHeads three, SimulateHeads(3, slices));
  EXPECT_EQ(one.free.hu, three.free.hu);
  EXPECT_EQ(one.fillings.hu, three.fillings.hu);
  EXPECT_EQ(one.braces.hu, three.braces.hu);
  const auto most = [](const CtVolume& volume) {
    return *std::max_element(volume.hu.begin(), volume.hu.end());
  };
  EXPECT_EQ(most(one.fillings), 3071);
  EXPECT_EQ(most(one.braces), 3071);
  for (int k = 0; k < one.free.size[2]; ++k) {
    const bool scanned = std::find(one.slices.begin(), one.slices.end(), k) != one.slices.end();
    const auto slice = [&](const CtVolume& volume) {
      const auto first = volume.hu.begin() + int64_t{k} * 256 * 256;
      return std::vector<int16_t>(first, first + int64_t{256} * 256);
    };
    EXPECT_EQ(slice(one.free) == slice(one.fillings), !scanned || k == 70) << k;
    EXPECT_EQ(slice(one.free) == slice(one.braces), !scanned || k == 54) << k;
  }
}

}  // namespace
}  // namespace tissueform::testing
