// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/parallel_beam.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tissueform {
namespace {

constexpr int kMarginBins = 4;

// The image with rows and columns exchanged, so that rays that run along columns read memory in its
// order as well.
std::vector<float> Transposed(const std::vector<float>& image, int width, int height) {
  std::vector<float> turned(image.size());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      turned[static_cast<size_t>(x) * static_cast<size_t>(height) + static_cast<size_t>(y)] =
          image[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
    }
  }
  return turned;
}

// Sum over the lines of an image of the value at first + line * step along each, linear between
// centres, nothing beyond the outermost.
double SumAlong(const std::vector<float>& image, int length, int lines, double first, double step) {
  double sum = 0;
  double at = first;
  for (int line = 0; line < lines; ++line, at += step) {
    const double floor = std::floor(at);
    const auto lower = static_cast<int>(floor);
    if (lower < -1 || lower >= length) continue;
    const double part = at - floor;
    const float* const row = image.data() + static_cast<size_t>(line) * static_cast<size_t>(length);
    if (lower >= 0) sum += (1 - part) * row[lower];
    if (lower + 1 < length) sum += part * row[lower + 1];
  }
  return sum;
}

// One angle's filtered rays, and where the pixels of a row lie between them.
struct View {
  const float* values;
  float first;  // bin of the row's first pixel
  float step;   // bins from pixel to pixel
  float weight;
};

// The margin keeps every place between two bins. That the row is apart from the view, and the view
// a copy, lets the compiler work on several pixels at once: twice as fast.
void AddView(const View view, int width, float* __restrict__ row) {
  const float* __restrict__ const values = view.values;
  for (int x = 0; x < width; ++x) {
    const float at = view.first + static_cast<float>(x) * view.step;
    const auto lower = static_cast<int>(at);
    const float part = at - static_cast<float>(lower);
    row[x] += view.weight * (values[lower] + part * (values[lower + 1] - values[lower]));
  }
}

}  // namespace

ParallelBeam::ParallelBeam(const SliceShape& slice)
    : slice_(slice), bin_mm_(std::min(slice.pixel_width_mm, slice.pixel_height_mm)) {
  const double diagonal_mm =
      std::hypot(slice.width * slice.pixel_width_mm, slice.height * slice.pixel_height_mm);
  bins_ = static_cast<int>(std::ceil(diagonal_mm / bin_mm_)) + 2 * kMarginBins;
  angles_ = static_cast<int>(std::ceil(std::numbers::pi / 2 * diagonal_mm / bin_mm_));
  for (int a = 0; a < angles_; ++a) {
    const double angle = std::numbers::pi * (a + 0.5) / angles_;
    cosine_.push_back(std::cos(angle));
    sine_.push_back(std::sin(angle));
  }
}

std::vector<uint8_t> ParallelBeam::Shadow(const std::vector<uint8_t>& pixels) const {
  std::vector<uint8_t> shadow(static_cast<size_t>(angles_) * static_cast<size_t>(bins_), 0);
  size_t pixel = 0;
  for (int y = 0; y < slice_.height; ++y) {
    for (int x = 0; x < slice_.width; ++x, ++pixel) {
      if (pixels[pixel] == 0) continue;
      const double x_mm = (x - (slice_.width - 1) / 2.0) * slice_.pixel_width_mm;
      const double y_mm = (y - (slice_.height - 1) / 2.0) * slice_.pixel_height_mm;
      for (int a = 0; a < angles_; ++a) {
        const auto angle = static_cast<size_t>(a);
        const double half_mm = (std::abs(cosine_[angle]) * slice_.pixel_width_mm +
                                std::abs(sine_[angle]) * slice_.pixel_height_mm) /
                               2;
        const double middle =
            (x_mm * cosine_[angle] + y_mm * sine_[angle]) / bin_mm_ + (bins_ - 1) / 2.0;
        const double reach = half_mm / bin_mm_ + 0.5;
        const int first = std::max(0, static_cast<int>(std::ceil(middle - reach)));
        const int last = std::min(bins_ - 1, static_cast<int>(std::floor(middle + reach)));
        uint8_t* const row = shadow.data() + angle * static_cast<size_t>(bins_);
        if (first <= last) std::fill(row + first, row + last + 1, 1);
      }
    }
  }
  return shadow;
}

Sinogram ParallelBeam::Project(const std::vector<float>& image,
                               const std::vector<uint8_t>& wanted) const {
  const std::vector<float> turned = Transposed(image, slice_.width, slice_.height);
  Sinogram sinogram{angles_, bins_, std::vector<float>(wanted.size(), 0.0F)};
  const double dx = slice_.pixel_width_mm;
  const double dy = slice_.pixel_height_mm;
  const double middle_x = (slice_.width - 1) / 2.0;
  const double middle_y = (slice_.height - 1) / 2.0;
  for (int a = 0; a < angles_; ++a) {
    const double c = cosine_[static_cast<size_t>(a)];
    const double s = sine_[static_cast<size_t>(a)];
    // A ray holds x c + y s = t. It is sampled once a column where it runs rather along the rows,
    // once a row otherwise.
    const bool along_rows = std::abs(s) * dy >= std::abs(c) * dx;
    for (int b = 0; b < bins_; ++b) {
      const size_t ray = sinogram.Row(a) + static_cast<size_t>(b);
      if (wanted[ray] == 0) continue;
      const double t = (b - (bins_ - 1) / 2.0) * bin_mm_;
      if (along_rows) {
        const double first = (t + middle_x * dx * c) / (s * dy) + middle_y;
        sinogram.values[ray] = static_cast<float>(
            dx / std::abs(s) *
            SumAlong(turned, slice_.height, slice_.width, first, -dx * c / (s * dy)));
      } else {
        const double first = (t + middle_y * dy * s) / (c * dx) + middle_x;
        sinogram.values[ray] = static_cast<float>(
            dy / std::abs(c) *
            SumAlong(image, slice_.width, slice_.height, first, -dy * s / (c * dx)));
      }
    }
  }
  return sinogram;
}

// In the plain way: only few rays differ from 0, those of metal, and every second weight is 0.
std::vector<float> ParallelBeam::Filter(const Sinogram& sinogram) const {
  std::vector<float> weights(static_cast<size_t>(bins_), 0.0F);
  weights[0] = static_cast<float>(1 / (4 * bin_mm_));
  for (int n = 1; n < bins_; n += 2) {
    weights[static_cast<size_t>(n)] =
        static_cast<float>(-1 / (std::numbers::pi * std::numbers::pi * n * n * bin_mm_));
  }
  std::vector<float> filtered(sinogram.values.size(), 0.0F);
  for (int a = 0; a < angles_; ++a) {
    const float* const from = sinogram.values.data() + sinogram.Row(a);
    float* const to = filtered.data() + sinogram.Row(a);
    for (int b = 0; b < bins_; ++b) {
      const float value = from[b];
      if (value == 0) continue;
      to[b] += weights[0] * value;
      for (int n = 1; n <= b; n += 2) to[b - n] += weights[static_cast<size_t>(n)] * value;
      for (int n = 1; b + n < bins_; n += 2) to[b + n] += weights[static_cast<size_t>(n)] * value;
    }
  }
  return filtered;
}

void ParallelBeam::AddBackProjection(const Sinogram& sinogram, std::vector<float>* image) const {
  const std::vector<float> filtered = Filter(sinogram);
  const auto weight = static_cast<float>(std::numbers::pi / angles_);
  const double left_mm = -(slice_.width - 1) / 2.0 * slice_.pixel_width_mm;
  for (int y = 0; y < slice_.height; ++y) {
    float* const row = image->data() + static_cast<size_t>(y) * static_cast<size_t>(slice_.width);
    const double y_mm = (y - (slice_.height - 1) / 2.0) * slice_.pixel_height_mm;
    for (int a = 0; a < angles_; ++a) {
      const auto angle = static_cast<size_t>(a);
      const double left = (left_mm * cosine_[angle] + y_mm * sine_[angle]) / bin_mm_;
      const auto step = static_cast<float>(slice_.pixel_width_mm * cosine_[angle] / bin_mm_);
      AddView({filtered.data() + sinogram.Row(a), static_cast<float>(left + (bins_ - 1) / 2.0),
               step, weight},
              slice_.width, row);
    }
  }
}

}  // namespace tissueform
