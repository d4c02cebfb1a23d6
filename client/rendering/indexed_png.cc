// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/rendering/indexed_png.h"

#include <cmath>
#include <cstdint>
#include <png.h>
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

// Row by row from the top; VTK counts from the bottom.
std::vector<uint8_t> Indices(vtkImageData* indexed, int width, int height) {
  std::vector<uint8_t> indices;
  indices.reserve(static_cast<size_t>(width) * height);
  for (int row = height - 1; row >= 0; --row) {
    const auto* pixels = static_cast<const uint16_t*>(indexed->GetScalarPointer(0, row, 0));
    for (int column = 0; column < width; ++column) {
      indices.push_back(static_cast<uint8_t>(pixels[column]));
    }
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
  const std::vector<uint8_t> indices = Indices(quantize->GetOutput(), width, height);

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
    return absl::InternalError(absl::StrCat("libpng makes no picture: ", image.message));
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace tissueform
