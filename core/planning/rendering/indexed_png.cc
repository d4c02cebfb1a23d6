// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/indexed_png.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <png.h>
#include <unordered_map>
#include <vector>
#include <vtkImageQuantizeRGBToIndex.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr int kColours = 256;

std::vector<uint8_t> Palette(vtkLookupTable* table) {
  std::vector<uint8_t> palette;
  for (int c = 0; c < kColours; ++c) {
    double rgba[4];
    table->GetTableValue(c, rgba);
    for (int channel = 0; channel < 3; ++channel) {
      palette.push_back(static_cast<uint8_t>(std::lround(255 * rgba[channel])));
    }
  }
  return palette;
}

// The index of the nearest colour of a palette. VTK's own index is that of the box of colours into
// which a pixel falls, and a box may be long: threads of grey lay on cheeks where its mean is far.
class NearestColour {
 public:
  explicit NearestColour(const std::vector<uint8_t>& palette) : palette_(palette) {}

  uint8_t operator()(const uint8_t* rgb) {
    const int packed = (256 * rgb[0] + rgb[1]) * 256 + rgb[2];
    // Smooth pictures have some ten thousand colours for a million pixels.
    const auto [known, is_new] = known_.try_emplace(packed, 0);
    if (is_new) known->second = Search(rgb);
    return known->second;
  }

 private:
  uint8_t Search(const uint8_t* rgb) const {
    int nearest = 0;
    int smallest = std::numeric_limits<int>::max();
    for (int c = 0; c < kColours; ++c) {
      int distance = 0;
      for (int channel = 0; channel < 3; ++channel) {
        const int step = palette_[3 * c + channel] - rgb[channel];
        distance += step * step;
      }
      if (distance >= smallest) continue;
      smallest = distance;
      nearest = c;
    }
    return static_cast<uint8_t>(nearest);
  }

  const std::vector<uint8_t>& palette_;
  std::unordered_map<int, uint8_t> known_;
};

// Row by row from the top; VTK counts from the bottom.
std::vector<uint8_t> Indices(vtkImageData* picture, const std::vector<uint8_t>& palette) {
  const int width = picture->GetDimensions()[0];
  const int height = picture->GetDimensions()[1];
  NearestColour nearest(palette);
  std::vector<uint8_t> indices;
  indices.reserve(static_cast<size_t>(width) * height);
  for (int row = height - 1; row >= 0; --row) {
    const auto* pixels = static_cast<const uint8_t*>(picture->GetScalarPointer(0, row, 0));
    for (int column = 0; column < width; ++column) indices.push_back(nearest(pixels + 3 * column));
  }
  return indices;
}

}  // namespace

absl::StatusOr<std::string> EncodeIndexedPng(vtkImageData* picture) {
  vtkNew<vtkImageQuantizeRGBToIndex> quantize;
  quantize->SetInputData(picture);
  quantize->SetNumberOfColors(kColours);
  quantize->SetSamplingRate(2, 2, 1);  // to choose the colours; half the time
  quantize->Update();
  const int width = picture->GetDimensions()[0];
  const int height = picture->GetDimensions()[1];
  const std::vector<uint8_t> palette = Palette(quantize->GetLookupTable());
  const std::vector<uint8_t> indices = Indices(picture, palette);

  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = PNG_FORMAT_RGB_COLORMAP;
  image.colormap_entries = kColours;
  // More than a picture can take: an index a pixel, the palette and what deflate adds at worst.
  std::string bytes(indices.size() + indices.size() / 100 + 65536, '\0');
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, indices.data(), width,
                                palette.data()) == 0) {
    return absl::InternalError(absl::StrCat("libpng cannot write the picture: ", image.message));
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace tissueform
