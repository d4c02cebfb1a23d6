// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <filesystem>
#include <png.h>

#include "core/planning/rendering/figure.h"
#include "core/planning/rendering/panels.h"
#include "core/planning/rendering/virtual_display.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::IsOk;

constexpr int kSide = 40;

// Red above left, green above right, blue below left, grey below right.
Picture FourQuarters() {
  Picture picture{.title = "", .width = kSide, .height = kSide, .rgb = {}};
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const bool above = row < kSide / 2;
      const bool left = column < kSide / 2;
      const std::array<uint8_t, 3> colour =
          above ? (left ? std::array<uint8_t, 3>{255, 0, 0} : std::array<uint8_t, 3>{0, 255, 0})
                : (left ? std::array<uint8_t, 3>{0, 0, 255} : std::array<uint8_t, 3>{99, 99, 99});
      picture.rgb.insert(picture.rgb.end(), colour.begin(), colour.end());
    }
  }
  return picture;
}

struct Centre {
  double column = 0;
  double row = 0;
};

// Of all pixels that fit, in a PNG file.
template <typename Fits>
Centre CentreOf(const std::string& path, Fits fits) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_file(&image, path.c_str()), 0);
  image.format = PNG_FORMAT_RGB;
  std::vector<uint8_t> pixels(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  Centre centre;
  double count = 0;
  for (size_t p = 0; p < pixels.size() / 3; ++p) {
    if (!fits(pixels[3 * p], pixels[3 * p + 1], pixels[3 * p + 2])) continue;
    centre.column += static_cast<double>(p % image.width);
    const size_t row = p / image.width;
    centre.row += static_cast<double>(row);
    ++count;
  }
  EXPECT_GT(count, 100);
  return {centre.column / count, centre.row / count};
}

TEST(PictureTest, FirstPixelIsAboveLeft) {
  const auto display = VirtualDisplay::Open();
  if (absl::IsNotFound(display.status())) GTEST_SKIP() << display.status();
  ASSERT_THAT(display, IsOk());
  const std::string path = ::testing::TempDir() + "/picture_test.png";
  Figure figure("", 200);
  figure.AddRow(200, {FourQuarters()});
  ASSERT_THAT(figure.WritePng(path), IsOk());
  const Centre red = CentreOf(path, [](int r, int g, int b) { return r > 200 && g + b < 60; });
  const Centre green = CentreOf(path, [](int r, int g, int b) { return g > 200 && r + b < 60; });
  const Centre blue = CentreOf(path, [](int r, int g, int b) { return b > 200 && r + g < 60; });
  std::filesystem::remove(path);
  EXPECT_NEAR(red.row, green.row, 1);
  EXPECT_NEAR(red.column, blue.column, 1);
  EXPECT_GT(green.column, red.column + 50);
  EXPECT_GT(blue.row, red.row + 50);
}

}  // namespace
}  // namespace tissueform
