// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/indexed_png.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <png.h>
#include <set>
#include <string>
#include <vector>
#include <vtkNew.h>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::IsOk;
using Rgb = std::array<uint8_t, 3>;

constexpr int kSide = 96;

// Thousands of colours, and a few pixels that are like no other.
Rgb ColourAt(int column, int row) {
  if (column == 40 && row % 8 == 0) return {120, 120, 120};
  return {static_cast<uint8_t>(255 - column), static_cast<uint8_t>(2 * row),
          static_cast<uint8_t>(60 + (column + row) / 4)};
}

std::vector<Rgb> Decoded(const std::string& png) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, png.data(), png.size()), 0);
  EXPECT_EQ(image.width, kSide);
  EXPECT_EQ(image.height, kSide);
  image.format = PNG_FORMAT_RGB;
  std::vector<Rgb> pixels(size_t{kSide} * kSide);
  EXPECT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  return pixels;
}

int SquaredDistance(const Rgb& a, const Rgb& b) {
  int sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

TEST(IndexedPngTest, NoColourOfThePictureIsNearerToAPixelThanItsOwn) {
  vtkNew<vtkImageData> picture;
  picture->SetDimensions(kSide, kSide, 1);
  picture->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const Rgb colour = ColourAt(column, row);
      // VTK counts from the bottom.
      std::copy(colour.begin(), colour.end(),
                static_cast<uint8_t*>(picture->GetScalarPointer(column, kSide - 1 - row, 0)));
    }
  }
  const auto png = EncodeIndexedPng(picture);
  ASSERT_THAT(png, IsOk());
  const std::vector<Rgb> pixels = Decoded(*png);
  const std::set<Rgb> colours(pixels.begin(), pixels.end());
  EXPECT_LE(colours.size(), 256);
  EXPECT_GT(colours.size(), 100);
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const Rgb wanted = ColourAt(column, row);
      int nearest = std::numeric_limits<int>::max();
      for (const Rgb& colour : colours) {
        nearest = std::min(nearest, SquaredDistance(colour, wanted));
      }
      ASSERT_EQ(SquaredDistance(pixels[kSide * row + column], wanted), nearest)
          << "column " << column << ", row " << row;
    }
  }
}

}  // namespace
}  // namespace tissueform
