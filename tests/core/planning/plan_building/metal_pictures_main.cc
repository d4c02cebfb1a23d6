// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Draws the picture of docs/ct-input.md: tissueform-metal-pictures OUT.png. Slices of the bundled
// head, from above to below without metal, as the simulated scanner shows metal, and with its
// streaks reduced; two with fillings and two with braces.

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <png.h>
#include <string>
#include <vector>

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/imaging/metal/metal_detection.h"
#include "core/imaging/metal/metal_reduction.h"
#include "tests/testing/metal_phantom.h"

namespace tissueform::testing {
namespace {

// The slices, and of each the part that holds the head.
constexpr std::array<int, 2> kOfFillings = {57, 63};
constexpr std::array<int, 2> kOfBraces = {60, 70};
constexpr int kFirstColumn = 30;
constexpr int kFirstRow = 25;
constexpr int kWidth = 190;
constexpr int kHeight = 150;
constexpr int kGap = 4;

// Soft tissue and bone, in few levels: the picture stays small.
constexpr double kBlackHu = -300;
constexpr double kWhiteHu = 900;
constexpr int kLevels = 32;

uint8_t GreyOf(int16_t hu) {
  const double part = std::clamp((hu - kBlackHu) / (kWhiteHu - kBlackHu), 0.0, 1.0);
  return static_cast<uint8_t>(std::lround(part * (kLevels - 1)) * 255 / (kLevels - 1));
}

class Sheet {
 public:
  Sheet(int columns, int rows)
      : width_(columns * (kWidth + kGap) - kGap),
        height_(rows * (kHeight + kGap) - kGap),
        grey_(static_cast<size_t>(width_ * height_), 255) {}

  void Draw(const CtVolume& volume, int slice, int column, int row) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const int to = column * (kWidth + kGap) + x + width_ * (row * (kHeight + kGap) + y);
        grey_[static_cast<size_t>(to)] = GreyOf(volume.At(kFirstColumn + x, kFirstRow + y, slice));
      }
    }
  }

  absl::Status Write(const std::string& path) const {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width_);
    image.height = static_cast<png_uint_32>(height_);
    image.format = PNG_FORMAT_GRAY;
    if (png_image_write_to_file(&image, path.c_str(), 0, grey_.data(), 0, nullptr) != 0) {
      return absl::OkStatus();
    }
    return absl::UnavailableError(image.message);
  }

 private:
  int width_;
  int height_;
  std::vector<uint8_t> grey_;
};

absl::Status DrawSheet(const std::string& path) {
  const int threads = AvailableProcessors();
  TF_ASSIGN_OR_RETURN(const SimulatedHeads heads, SimulateHeads(threads));
  Sheet sheet(4, 3);
  const auto draw = [&](const CtVolume& metal, const std::array<int, 2>& slices, int column) {
    CtVolume lessened = metal;
    ReduceMetalArtifacts(FindMetal(metal), threads, &lessened);
    for (const int slice : slices) {
      sheet.Draw(heads.free, slice, column, 0);
      sheet.Draw(metal, slice, column, 1);
      sheet.Draw(lessened, slice, column, 2);
      ++column;
    }
  };
  draw(heads.fillings, kOfFillings, 0);
  draw(heads.braces, kOfBraces, 2);
  return sheet.Write(path);
}

}  // namespace
}  // namespace tissueform::testing

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: tissueform-metal-pictures OUT.png\n";
    return 2;
  }
  const absl::Status drawn = tissueform::testing::DrawSheet(argv[1]);
  if (drawn.ok()) return 0;
  std::cerr << drawn.message() << '\n';
  return 1;
}
