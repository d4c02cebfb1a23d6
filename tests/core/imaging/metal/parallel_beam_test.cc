// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/parallel_beam.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

struct Disc {
  double x_mm = 0;  // from the slice's middle
  double y_mm = 0;
  double radius_mm = 1;
};

// Integral of a disc of density 1 along x cos + y sin = t.
double Chord(const Disc& disc, double angle, double t_mm) {
  const double off = t_mm - disc.x_mm * std::cos(angle) - disc.y_mm * std::sin(angle);
  return 2 * std::sqrt(std::max(0.0, disc.radius_mm * disc.radius_mm - off * off));
}

// Share of every pixel that lies in the disc, of 8 by 8 points.
std::vector<float> Drawn(const Disc& disc, const SliceShape& shape) {
  std::vector<float> image;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      int inside = 0;
      for (int sample = 0; sample < 64; ++sample) {
        const int column = sample % 8;
        const int row = sample / 8;
        const double u = (x + (column + 0.5) / 8 - shape.width / 2.0) * shape.pixel_width_mm;
        const double v = (y + (row + 0.5) / 8 - shape.height / 2.0) * shape.pixel_height_mm;
        if (std::hypot(u - disc.x_mm, v - disc.y_mm) < disc.radius_mm) ++inside;
      }
      image.push_back(static_cast<float>(inside) / 64);
    }
  }
  return image;
}

double AngleOf(const ParallelBeam& beam, int a) {
  return std::numbers::pi * (a + 0.5) / beam.angles();
}
double PlaceOf(const ParallelBeam& beam, int b) {
  return (b - (beam.bins() - 1) / 2.0) * beam.bin_mm();
}

constexpr Disc kDisc = {12, -7, 20};

// Square pixels, and a file whose slices have pixels of two lengths.
std::vector<SliceShape> Shapes() { return {{120, 90, 0.8, 0.8}, {90, 60, 1.0, 1.5}}; }

TEST(ParallelBeamTest, RaysThroughADiscAreItsChords) {
  for (const SliceShape& shape : Shapes()) {
    const ParallelBeam beam(shape);
    const std::vector<uint8_t> all(
        static_cast<size_t>(beam.angles()) * static_cast<size_t>(beam.bins()), 1);
    const Sinogram sinogram = beam.Project(Drawn(kDisc, shape), all);
    double error = 0;
    double most = 0;
    for (int a = 0; a < beam.angles(); ++a) {
      for (int b = 0; b < beam.bins(); ++b) {
        const double chord = Chord(kDisc, AngleOf(beam, a), PlaceOf(beam, b));
        const double off =
            std::abs(sinogram.values[sinogram.Row(a) + static_cast<size_t>(b)] - chord);
        error += off / static_cast<double>(all.size());
        most = std::max(most, off);
      }
    }
    EXPECT_LT(error, 0.1);  // mm, of chords of up to 40
    EXPECT_LT(most, 8);     // at the rim, where the chord grows by 8 mm within half a pixel
  }
}

TEST(ParallelBeamTest, ARayThatIsNotWantedIsNotMeasured) {
  const SliceShape shape = Shapes()[0];
  const ParallelBeam beam(shape);
  std::vector<uint8_t> none(static_cast<size_t>(beam.angles()) * static_cast<size_t>(beam.bins()),
                            0);
  const Sinogram sinogram = beam.Project(Drawn(kDisc, shape), none);
  EXPECT_TRUE(std::all_of(sinogram.values.begin(), sinogram.values.end(),
                          [](float value) { return value == 0; }));
}

// A dome, 1 - (r / radius)^2, as a disc's rim has edges that no bin can hold.
TEST(ParallelBeamTest, TheBackProjectionOfADomesIntegralsIsTheDome) {
  for (const SliceShape& shape : Shapes()) {
    const ParallelBeam beam(shape);
    const double square = kDisc.radius_mm * kDisc.radius_mm;
    Sinogram sinogram{beam.angles(), beam.bins(), {}};
    for (int a = 0; a < beam.angles(); ++a) {
      for (int b = 0; b < beam.bins(); ++b) {
        const double half = Chord(kDisc, AngleOf(beam, a), PlaceOf(beam, b)) / 2;
        sinogram.values.push_back(static_cast<float>(4.0 / 3 * half * half * half / square));
      }
    }
    std::vector<float> image(shape.num_pixels(), 0.5F);  // is added to
    beam.AddBackProjection(sinogram, &image);
    size_t pixel = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x, ++pixel) {
        const double r =
            std::hypot((x - (shape.width - 1) / 2.0) * shape.pixel_width_mm - kDisc.x_mm,
                       (y - (shape.height - 1) / 2.0) * shape.pixel_height_mm - kDisc.y_mm);
        ASSERT_NEAR(image[pixel], 0.5 + std::max(0.0, 1 - r * r / square), 0.02) << x << " " << y;
      }
    }
  }
}

TEST(ParallelBeamTest, TheShadowOfAPixelHoldsEveryRayThatItChanges) {
  const SliceShape shape = Shapes()[1];
  const ParallelBeam beam(shape);
  std::vector<uint8_t> marked(shape.num_pixels(), 0);
  std::vector<float> image(shape.num_pixels(), 0.0F);
  for (const size_t pixel : {size_t{0}, size_t{2000}, shape.num_pixels() - 1}) {
    marked[pixel] = 1;
    image[pixel] = 1;
  }
  const std::vector<uint8_t> shadow = beam.Shadow(marked);
  const Sinogram rays = beam.Project(image, std::vector<uint8_t>(shadow.size(), 1));
  double seen = 0;
  double missed = 0;
  for (size_t ray = 0; ray < shadow.size(); ++ray) {
    (shadow[ray] != 0 ? seen : missed) += rays.values[ray];
  }
  EXPECT_GT(seen, 0);
  EXPECT_LT(missed, 0.02 * seen);  // the linear interpolation between pixels reaches a little wider
  EXPECT_LT(std::count(shadow.begin(), shadow.end(), 1), static_cast<int64_t>(shadow.size()) / 10);
}

}  // namespace
}  // namespace tissueform
