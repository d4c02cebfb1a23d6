// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/metal_reduction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gtest/gtest.h"

#include "core/imaging/ct/isotropic_resample.h"
#include "core/imaging/metal/parallel_beam.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// Ellipses of a density that is added, in mm about the middle: a head with a jaw, in water.
struct Ellipse {
  double x, y, a, b, density;
};

constexpr int kSize = 128;
constexpr int kSlices = 7;
constexpr int kMetalSlice = 3;
constexpr double kPixelMm = 1;

std::vector<Ellipse> Head() {
  return {{0, 0, 48, 55, 1.04}, {0, 5, 40, 46, -0.04}, {-24, -8, 5, 17, 1.0},
          {24, -8, 5, 17, 1.0}, {-16, -34, 6, 6, 1.3}, {16, -34, 6, 6, 1.3},
          {0, -38, 6, 5, 1.2},  {0, 12, 9, 5, -0.95},  {0, 36, 14, 10, 0.5}};
}
std::vector<Ellipse> Fillings() { return {{-24, -8, 3, 4, 9}, {25, -5, 3, 3, 9}}; }

double Integral(const std::vector<Ellipse>& ellipses, double angle, double t) {
  double sum = 0;
  for (const Ellipse& e : ellipses) {
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const double r2 = e.a * e.a * c * c + e.b * e.b * s * s;
    const double off = t - e.x * c - e.y * s;
    if (off * off < r2) sum += e.density * 2 * e.a * e.b * std::sqrt(r2 - off * off) / r2;
  }
  return sum;
}

// Reconstructed from exact integrals, those through metal wrong as a scanner's are: dense rays
// count less than they should (beam hardening), and beyond 180 mm of water there is no light left.
// On pixels of half the size, of which four make one: a scanner sees finer than its pixels, too.
std::vector<float> Scanned(bool with_metal) {
  constexpr int kFine = 2 * kSize;
  const ParallelBeam beam({kFine, kFine, kPixelMm / 2, kPixelMm / 2});
  Sinogram sinogram{beam.angles(), beam.bins(), {}};
  for (int a = 0; a < beam.angles(); ++a) {
    const double angle = std::numbers::pi * (a + 0.5) / beam.angles();
    for (int b = 0; b < beam.bins(); ++b) {
      const double t = (b - (beam.bins() - 1) / 2.0) * beam.bin_mm();
      const double metal = with_metal ? Integral(Fillings(), angle, t) : 0;
      const double seen = Integral(Head(), angle, t) + 60 * (1 - std::exp(-metal / 60));
      sinogram.values.push_back(static_cast<float>(metal > 0 ? std::min(seen, 180.0) : seen));
    }
  }
  std::vector<float> fine(static_cast<size_t>(kFine) * kFine, 0.0F);
  beam.AddBackProjection(sinogram, &fine);
  std::vector<float> image(static_cast<size_t>(kSize) * kSize, 0.0F);
  for (size_t y = 0; y < kFine; ++y) {
    for (size_t x = 0; x < kFine; ++x) image[y / 2 * kSize + x / 2] += fine[y * kFine + x] / 4;
  }
  return image;
}

void PutSlice(const std::vector<float>& image, int slice, CtVolume* volume) {
  for (size_t i = 0; i < image.size(); ++i) {
    const double hu = std::round(1000.0 * (image[i] - 1));
    volume->hu[static_cast<size_t>(slice) * image.size() + i] =
        static_cast<int16_t>(std::clamp(hu, -1024.0, 3071.0));
  }
}

CtVolume Volume(bool with_metal) {
  CtVolume volume;
  volume.size = {kSize, kSize, kSlices};
  volume.spacing_mm = {kPixelMm, kPixelMm, 1};
  volume.hu.resize(static_cast<size_t>(kSize) * kSize * kSlices);
  const std::vector<float> clean = Scanned(false);
  const std::vector<float> spoiled = Scanned(true);
  for (int slice = 0; slice < kSlices; ++slice) {
    PutSlice(with_metal && slice == kMetalSlice ? spoiled : clean, slice, &volume);
  }
  return volume;
}

// Root mean square of what two volumes differ in the slice with metal, 3 mm and more from metal,
// within the head.
double ErrorHu(const CtVolume& volume, const CtVolume& truth) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double u = x - (kSize - 1) / 2.0;
      const double v = y - (kSize - 1) / 2.0;
      if (std::hypot(u / 48, v / 55) > 1) continue;
      const auto near = [&](const Ellipse& e) {
        return std::hypot((u - e.x) / (e.a + 3), (v - e.y) / (e.b + 3)) < 1;
      };
      const std::vector<Ellipse> fillings = Fillings();
      if (std::any_of(fillings.begin(), fillings.end(), near)) continue;
      const double off = volume.At(x, y, kMetalSlice) - truth.At(x, y, kMetalSlice);
      sum += off * off;
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

TEST(MetalReductionTest, ACorrectedSliceIsNearerToTheTruth) {
  const CtVolume truth = Volume(false);
  CtVolume volume = Volume(true);
  const double before = ErrorHu(volume, truth);
  EXPECT_GT(before, 35);
  const MetalFindings findings = FindMetal(volume);
  ASSERT_EQ(findings.clusters.size(), 2U);
  const MetalReport report = ReduceMetalArtifacts(findings, 1, &volume);
  EXPECT_EQ(report.corrected_slices, 1);
  EXPECT_LT(ErrorHu(volume, truth), before / 1.6) << "before " << before;
}

TEST(MetalReductionTest, MetalStaysAndSlicesWithoutItAreAsTheyWere) {
  const CtVolume before = Volume(true);
  CtVolume after = before;
  const MetalFindings findings = FindMetal(before);
  ReduceMetalArtifacts(findings, 1, &after);
  const size_t slice = static_cast<size_t>(kSize) * kSize;
  for (size_t i = 0; i < before.hu.size(); ++i) {
    if (i / slice != kMetalSlice) {
      ASSERT_EQ(after.hu[i], before.hu[i]);
    }
    if (findings.mask[i] != 0) {
      ASSERT_GE(after.hu[i], 2500);
    }
  }
}

TEST(MetalReductionTest, TheResultDoesNotDependOnTheNumberOfThreads) {
  CtVolume one = Volume(true);
  for (int slice = 0; slice < kSlices; slice += 2) PutSlice(Scanned(true), slice, &one);
  CtVolume four = one;
  ReduceMetalArtifacts(FindMetal(one), 1, &one);
  ReduceMetalArtifacts(FindMetal(four), 4, &four);
  EXPECT_EQ(one.hu, four.hu);
}

TEST(MetalReductionTest, WithoutMetalTheGridIsThatOfTheCt) {
  const CtVolume volume = Volume(false);
  ASSERT_OK_AND_ASSIGN(const CtWithMetal found, ResampleWithoutStreaks(volume, 1, {}, 1));
  ASSERT_OK_AND_ASSIGN(const HuGrid plain, ResampleIsotropic(volume, 1));
  EXPECT_EQ(found.hu.values, plain.values);
  EXPECT_FALSE(found.report.any());
  EXPECT_TRUE(found.metal.values.empty());
}

TEST(MetalReductionTest, SwitchedOffItChangesNothing) {
  const CtVolume volume = Volume(true);
  ASSERT_OK_AND_ASSIGN(
      const CtWithMetal found,
      ResampleWithoutStreaks(volume, 1, {.correct = false, .threshold_hu = {}}, 1));
  ASSERT_OK_AND_ASSIGN(const HuGrid plain, ResampleIsotropic(volume, 1));
  EXPECT_EQ(found.hu.values, plain.values);
}

TEST(MetalReductionTest, TheMaskLiesOnTheGridWhereTheMetalIs) {
  const CtVolume volume = Volume(true);
  ASSERT_OK_AND_ASSIGN(const CtWithMetal found, ResampleWithoutStreaks(volume, 1, {}, 1));
  const MetalFindings findings = FindMetal(volume);
  EXPECT_EQ(found.metal.values, findings.mask);  // the grid is the volume's
  EXPECT_EQ(found.before.geometry.size[2], kSlices);
  EXPECT_EQ(found.before.values, volume.hu);
}

}  // namespace
}  // namespace tissueform
