// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/slice_stack.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace tissueform {
namespace {

constexpr int kLeastSoftHu = -300;
constexpr int kMaxSoftHu = 300;
constexpr double kBesideMm = 2;
constexpr int kLeastSamples = 50;

bool IsSoft(int16_t hu) { return hu > kLeastSoftHu && hu < kMaxSoftHu; }

}  // namespace

SliceStack::SliceStack(const CtVolume& volume) {
  Eigen::Index axis = 2;
  volume.direction.row(2).cwiseAbs().maxCoeff(&axis);
  const Eigen::Index column_axis = axis == 0 ? 1 : 0;
  const Eigen::Index row_axis = axis == 2 ? 1 : 2;
  const std::array<int64_t, 3> steps = {1, volume.size[0],
                                        int64_t{volume.size[0]} * volume.size[1]};
  const auto size = [&](Eigen::Index a) { return volume.size[static_cast<size_t>(a)]; };
  const auto step = [&](Eigen::Index a) { return steps[static_cast<size_t>(a)]; };
  slices = size(axis);
  slice_mm = volume.spacing_mm[axis];
  shape = {size(column_axis), size(row_axis), volume.spacing_mm[column_axis],
           volume.spacing_mm[row_axis]};
  to_next_slice = step(axis);
  to_next_column = step(column_axis);
  to_next_row = step(row_axis);
}

std::array<int, 3> SliceStack::Place(size_t index) const {
  const auto at = static_cast<int64_t>(index);
  return {static_cast<int>(at / to_next_slice % slices),
          static_cast<int>(at / to_next_column % shape.width),
          static_cast<int>(at / to_next_row % shape.height)};
}

void FillHoles(const SliceStack& stack, int slice, double largest_mm2, std::vector<uint8_t>* mask) {
  const int width = stack.shape.width;
  const int height = stack.shape.height;
  const auto largest =
      static_cast<size_t>(largest_mm2 / (stack.shape.pixel_width_mm * stack.shape.pixel_height_mm));
  std::vector<int> searches(stack.shape.num_pixels(), 0);  // that came by, 0 none
  int search = 0;
  std::vector<std::array<int, 2>> part;
  bool open = false;
  const auto visit = [&](int x, int y) {
    open = open || x < 0 || y < 0 || x >= width || y >= height;
    if (open) return;
    const size_t pixel =
        static_cast<size_t>(x) + static_cast<size_t>(y) * static_cast<size_t>(width);
    if (searches[pixel] == search || (*mask)[stack.Index(slice, x, y)] != 0) return;
    // What an earlier search has been to and not filled is too large, or has no end.
    open = searches[pixel] != 0;
    searches[pixel] = search;
    part.push_back({x, y});
  };
  const auto fill_from = [&](int start_x, int start_y) {
    part.clear();
    open = false;
    ++search;
    visit(start_x, start_y);
    for (size_t next = 0; next < part.size() && !open && part.size() <= largest; ++next) {
      const auto [x, y] = part[next];
      visit(x - 1, y);
      visit(x + 1, y);
      visit(x, y - 1);
      visit(x, y + 1);
    }
    if (open || part.size() > largest) return;
    for (const auto& [x, y] : part) (*mask)[stack.Index(slice, x, y)] = 1;
  };
  // Every hole has a voxel to the right of metal.
  for (int y = 0; y < height; ++y) {
    for (int x = 1; x < width; ++x) {
      if ((*mask)[stack.Index(slice, x - 1, y)] != 0) fill_from(x, y);
    }
  }
}

double Roughness(const CtVolume& volume, const SliceStack& stack, int slice,
                 const std::array<int, 2>& first, const std::array<int, 2>& last) {
  const int dx = std::max(1, static_cast<int>(std::lround(kBesideMm / stack.shape.pixel_width_mm)));
  const int dy =
      std::max(1, static_cast<int>(std::lround(kBesideMm / stack.shape.pixel_height_mm)));
  const auto hu = [&](int x, int y) { return volume.hu[stack.Index(slice, x, y)]; };
  double sum = 0;
  int count = 0;
  const auto add = [&](int16_t middle, int16_t before, int16_t after) {
    if (!IsSoft(middle) || !IsSoft(before) || !IsSoft(after)) return;
    sum += std::abs(middle - (before + after) / 2.0);
    ++count;
  };
  for (int y = std::max(first[1], dy); y <= std::min(last[1], stack.shape.height - 1 - dy); ++y) {
    for (int x = std::max(first[0], dx); x <= std::min(last[0], stack.shape.width - 1 - dx); ++x) {
      add(hu(x, y), hu(x - dx, y), hu(x + dx, y));
      add(hu(x, y), hu(x, y - dy), hu(x, y + dy));
    }
  }
  return count < kLeastSamples ? -1 : sum / count;
}

}  // namespace tissueform
