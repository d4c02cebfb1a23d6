// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/slice_correction.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissueform {
namespace {

// So many bins beside the trace are averaged: one alone is noisy.
constexpr int kBesideBins = 2;

// Where the classes of the prior end. Streaks of up to 200 HU leave no trace in it. Hard limits
// would move every edge by a part of a pixel, which shows in the corrected slice as an outline of
// the airway: on a head with simulated brackets they doubled the error far from the metal.
constexpr float kAirEnds = 0.3F;
constexpr float kTissueBegins = 0.85F;
constexpr float kTissueEnds = 1.2F;
constexpr float kBoneBegins = 1.4F;
constexpr float kTissue = 1.03F;  // muscle
constexpr float kHalfTissue = 0.6F;
constexpr float kBrightestStreak = 1.5F;

float ClassOf(float density) {
  if (density < kAirEnds) return 0;
  if (density < kTissueBegins) return kTissue * (density - kAirEnds) / (kTissueBegins - kAirEnds);
  if (density < kTissueEnds) return kTissue;
  if (density > kBoneBegins) return density;
  const float part = (density - kTissueEnds) / (kBoneBegins - kTissueEnds);
  return (1 - part) * kTissue + part * kBoneBegins;
}

// Calls visit(first, last) for the runs of rays in a view that are marked.
template <typename Visit>
void ForEachRun(const uint8_t* marked, int size, const Visit& visit) {
  for (int first = 0; first < size; ++first) {
    if (marked[first] == 0) continue;
    int last = first;
    while (last + 1 < size && marked[last + 1] != 0) ++last;
    visit(first, last);
    first = last;
  }
}

// The mean of up to kBesideBins unmarked rays, from `from` on in that direction.
float MeanBeside(const float* values, const uint8_t* marked, int size, int from, int direction) {
  float sum = 0;
  int count = 0;
  for (int b = from; b >= 0 && b < size && count < kBesideBins && marked[b] == 0; b += direction) {
    sum += values[b];
    ++count;
  }
  return count == 0 ? 0 : sum / static_cast<float>(count);
}

// In place, view by view: marked rays become linear between those beside them.
void InterpolateMarked(const std::vector<uint8_t>& marked, Sinogram* sinogram) {
  for (int a = 0; a < sinogram->angles; ++a) {
    float* const view = sinogram->values.data() + sinogram->Row(a);
    const uint8_t* const marks = marked.data() + sinogram->Row(a);
    ForEachRun(marks, sinogram->bins, [&](int first, int last) {
      const float before = MeanBeside(view, marks, sinogram->bins, first - 1, -1);
      const float after = MeanBeside(view, marks, sinogram->bins, last + 1, 1);
      const auto steps = static_cast<float>(last - first + 2);
      for (int b = first; b <= last; ++b) {
        const float part = static_cast<float>(b - first + 1) / steps;
        view[b] = (1 - part) * before + part * after;
      }
    });
  }
}

void SmoothAlong(int length, int lines, size_t step, size_t to_next_line, double sigma_px,
                 std::vector<float>* image) {
  const int reach = static_cast<int>(std::ceil(3 * sigma_px));
  std::vector<float> weights;
  float sum = 0;
  for (int n = -reach; n <= reach; ++n) {
    weights.push_back(static_cast<float>(std::exp(-n * n / (2 * sigma_px * sigma_px))));
    sum += weights.back();
  }
  std::vector<float> line(static_cast<size_t>(length));
  for (int l = 0; l < lines; ++l) {
    const size_t start = static_cast<size_t>(l) * to_next_line;
    for (int i = 0; i < length; ++i)
      line[static_cast<size_t>(i)] = (*image)[start + static_cast<size_t>(i) * step];
    for (int i = 0; i < length; ++i) {
      float value = 0;
      for (int n = -reach; n <= reach; ++n) {
        const int at = std::clamp(i + n, 0, length - 1);
        value += weights[static_cast<size_t>(n + reach)] * line[static_cast<size_t>(at)];
      }
      (*image)[start + static_cast<size_t>(i) * step] = value / sum;
    }
  }
}

std::vector<float> Smoothed(std::vector<float> image, const SliceShape& shape, double sigma_mm) {
  const auto width = static_cast<size_t>(shape.width);
  SmoothAlong(shape.width, shape.height, 1, width, sigma_mm / shape.pixel_width_mm, &image);
  SmoothAlong(shape.height, shape.width, width, 1, sigma_mm / shape.pixel_height_mm, &image);
  return image;
}

}  // namespace

MetalSlice::MetalSlice(const ParallelBeam& beam, std::vector<float> densities,
                       std::vector<uint8_t> metal)
    : beam_(beam), densities_(std::move(densities)), metal_(std::move(metal)) {
  trace_ = beam_.Shadow(metal_);
  wanted_ = trace_;
  for (int a = 0; a < beam_.angles(); ++a) {
    const size_t row = static_cast<size_t>(a) * static_cast<size_t>(beam_.bins());
    ForEachRun(trace_.data() + row, beam_.bins(), [&](int first, int last) {
      const int from = std::max(0, first - kBesideBins);
      const int to = std::min(beam_.bins() - 1, last + kBesideBins);
      std::fill(wanted_.begin() + static_cast<int64_t>(row) + from,
                wanted_.begin() + static_cast<int64_t>(row) + to + 1, 1);
    });
  }
  measured_ = beam_.Project(densities_, wanted_);
}

std::vector<float> MetalSlice::Corrected(const std::vector<float>& prior) const {
  Sinogram replaced = beam_.Project(prior, wanted_);
  Sinogram beyond_prior = measured_;
  for (size_t ray = 0; ray < replaced.values.size(); ++ray) {
    beyond_prior.values[ray] -= replaced.values[ray];
  }
  InterpolateMarked(trace_, &beyond_prior);
  for (size_t ray = 0; ray < replaced.values.size(); ++ray) {
    replaced.values[ray] += beyond_prior.values[ray];
  }
  Sinogram change{replaced.angles, replaced.bins, std::vector<float>(trace_.size(), 0.0F)};
  for (size_t ray = 0; ray < trace_.size(); ++ray) {
    if (trace_[ray] != 0) change.values[ray] = replaced.values[ray] - measured_.values[ray];
  }
  std::vector<float> corrected = densities_;
  beam_.AddBackProjection(change, &corrected);
  return corrected;
}

std::vector<float> MakePrior(const std::vector<float>& densities,
                             const std::vector<float>& interpolated, const SliceShape& shape,
                             double smooth_mm) {
  std::vector<float> prior = Smoothed(densities, shape, smooth_mm);
  const std::vector<float> calm = Smoothed(interpolated, shape, 1.5 * smooth_mm);
  for (size_t i = 0; i < prior.size(); ++i) {
    const bool shadow = prior[i] < kTissueBegins && calm[i] >= kTissueBegins;
    const bool streak = prior[i] > kTissueEnds && prior[i] < kBrightestStreak &&
                        calm[i] > kHalfTissue && calm[i] < kTissueEnds;
    prior[i] = shadow || streak ? kTissue : ClassOf(prior[i]);
  }
  return prior;
}

}  // namespace tissueform
