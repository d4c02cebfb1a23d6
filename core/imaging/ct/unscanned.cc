// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/unscanned.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/parallel_for.h"
#include "core/imaging/ct/cylinder_field.h"
#include "core/imaging/ct/isotropic_resample.h"

namespace tissueform {
namespace {

constexpr int16_t kFillBelowHu = -900;
constexpr int16_t kTissueHu = -500;
// Between filling and circle one real CT has pixels that are 1 to 10 HU off the filling.
constexpr int kRimPixels = 2;
constexpr int16_t kRimHu = 12;
// Of the edge, as many pixels have air this deep behind them. Where the filling is air that was cut
// off at the lowest HU, tissue lies there: the blur of a skin is no wider.
constexpr int kDeepPixels = 4;
constexpr double kLeastInAir = 0.25;
constexpr int16_t kWholly = 1000;
// Streaks reach so far beyond the slices with metal; and the edge of a filling differs between
// slices by no more pixels, with its rim.
constexpr double kStreaksBesideMm = 5;
constexpr int kEdgePixels = 4;
constexpr double kAskew = 1e-6;

using Pixels = std::vector<std::array<int, 2>>;

constexpr std::array<std::array<int, 2>, 4> kSides = {{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};

// One slice: which of its pixels are filled.
class Slice {
 public:
  Slice(const CtVolume& volume, int k, uint8_t* filled)
      : width_(volume.size[0]),
        height_(volume.size[1]),
        hu_(volume.hu.data() + int64_t{k} * width_ * height_),
        filled_(filled) {}

  // Whether tissue ends on the filling. Without a filling no pixel is marked.
  bool Fill() {
    FloodFromBorder();
    const auto same = [](int16_t from, int16_t to) { return from == to; };
    const Pixels edge = Grow(Edge(), same);
    if (!EndsInAir(edge)) {
      std::fill_n(filled_, static_cast<size_t>(width_) * static_cast<size_t>(height_), uint8_t{0});
      return false;
    }
    const auto low = [](int16_t from, int16_t to) { return to <= from + kRimHu; };
    Pixels rim = edge;
    for (int step = 0; step < kRimPixels; ++step) rim = Grow(rim, low);
    return TouchesTissue();
  }

  bool TouchesTissue() const {
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        if (Hu(x, y) <= kTissueHu) continue;
        for (const auto& [dx, dy] : kSides) {
          if (Contains(x + dx, y + dy) && IsFilled(x + dx, y + dy)) return true;
        }
      }
    }
    return false;
  }

 private:
  bool Contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  size_t Index(int x, int y) const {
    return static_cast<size_t>(x) + static_cast<size_t>(width_) * static_cast<size_t>(y);
  }
  int16_t Hu(int x, int y) const { return hu_[Index(x, y)]; }
  bool IsFilled(int x, int y) const { return filled_[Index(x, y)] != 0; }

  // Low, and like all four neighbours: noise has no such pixels, or but few.
  bool IsFlat(int x, int y) const {
    const int16_t hu = Hu(x, y);
    if (hu > kFillBelowHu) return false;
    return std::all_of(kSides.begin(), kSides.end(), [&](const auto& side) {
      return !Contains(x + side[0], y + side[1]) || Hu(x + side[0], y + side[1]) == hu;
    });
  }

  void Visit(int x, int y, Pixels* waiting) {
    if (!Contains(x, y) || IsFilled(x, y) || !IsFlat(x, y)) return;
    filled_[Index(x, y)] = 1;
    waiting->push_back({x, y});
  }

  // From flat pixel to flat pixel, over one that is not: two fillings of their own values meet in
  // an edge whose pixels are like the neighbours on one side only.
  void FloodFromBorder() {
    Pixels waiting;
    for (int x = 0; x < width_; ++x) {
      Visit(x, 0, &waiting);
      Visit(x, height_ - 1, &waiting);
    }
    for (int y = 0; y < height_; ++y) {
      Visit(0, y, &waiting);
      Visit(width_ - 1, y, &waiting);
    }
    while (!waiting.empty()) {
      const auto [x, y] = waiting.back();
      waiting.pop_back();
      for (const auto& [dx, dy] : kSides) {
        for (int steps = 1; steps <= 3; ++steps) {
          const int to_x = x + steps * dx;
          const int to_y = y + steps * dy;
          if (!Contains(to_x, to_y) || Hu(to_x, to_y) > kFillBelowHu) break;
          Visit(to_x, to_y, &waiting);
        }
      }
    }
  }

  // The filled pixels beside others.
  Pixels Edge() const {
    Pixels edge;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        if (IsFilled(x, y) && std::any_of(kSides.begin(), kSides.end(), [&](const auto& side) {
              return Contains(x + side[0], y + side[1]) && !IsFilled(x + side[0], y + side[1]);
            })) {
          edge.push_back({x, y});
        }
      }
    }
    return edge;
  }

  // Whether so deep behind a pixel of the edge, on a side of it, all is air that is not filled.
  bool IsBeforeAir(const std::array<int, 2>& pixel) const {
    return std::any_of(kSides.begin(), kSides.end(), [&](const auto& side) {
      for (int step = 1; step <= kDeepPixels; ++step) {
        const int x = pixel[0] + step * side[0];
        const int y = pixel[1] + step * side[1];
        if (!Contains(x, y) || IsFilled(x, y) || Hu(x, y) > kTissueHu) return false;
      }
      return true;
    });
  }

  bool EndsInAir(const Pixels& edge) const {
    const auto before_air = std::count_if(edge.begin(), edge.end(),
                                          [this](const auto& pixel) { return IsBeforeAir(pixel); });
    return !edge.empty() &&
           static_cast<double>(before_air) >= kLeastInAir * static_cast<double>(edge.size());
  }

  // Fills what lies beside the edge and may join it: the new edge, with what of the old one stays.
  template <typename May>
  Pixels Grow(const Pixels& edge, const May& may) {
    Pixels next;
    for (const auto& [x, y] : edge) {
      bool is_edge = false;
      for (const auto& [dx, dy] : kSides) {
        if (!Contains(x + dx, y + dy) || IsFilled(x + dx, y + dy)) continue;
        if (may(Hu(x, y), Hu(x + dx, y + dy))) {
          filled_[Index(x + dx, y + dy)] = 1;
          next.push_back({x + dx, y + dy});
        } else {
          is_edge = true;
        }
      }
      if (is_edge) next.push_back({x, y});
    }
    return next;
  }

  int width_;
  int height_;
  const int16_t* hu_;
  uint8_t* filled_;
};

// Takes streaks of metal out of what is filled.
class StreakFilter {
 public:
  StreakFilter(const CtVolume& volume, const std::vector<uint8_t>& metal,
               std::vector<uint8_t>* filled)
      : width_(volume.size[0]), height_(volume.size[1]), filled_(*filled) {
    const auto slices = static_cast<size_t>(volume.size[2]);
    const size_t pixels = NumPixels();
    const auto reach = static_cast<size_t>(std::ceil(kStreaksBesideMm / volume.spacing_mm[2]));
    has_streaks_.assign(slices, false);
    for (size_t k = 0; k < slices; ++k) {
      const auto begin = metal.begin() + static_cast<std::ptrdiff_t>(k * pixels);
      if (std::find(begin, begin + static_cast<std::ptrdiff_t>(pixels), 1) ==
          begin + static_cast<std::ptrdiff_t>(pixels)) {
        continue;
      }
      for (size_t near = k - std::min(k, reach); near < std::min(slices, k + reach + 1); ++near) {
        has_streaks_[near] = true;
      }
    }
  }

  // Whether the slice was changed. It reads slices without streaks only: slices may run at once.
  bool Run(size_t k) {
    if (!has_streaks_[k]) return false;
    std::vector<uint8_t> circle(NumPixels(), 0);
    bool any = false;
    for (const int step : {-1, 1}) {
      auto other = static_cast<std::ptrdiff_t>(k);
      while (InStack(other) && has_streaks_[static_cast<size_t>(other)]) other += step;
      if (!InStack(other)) continue;
      any = true;
      for (size_t i = 0; i < circle.size(); ++i) circle[i] |= SliceOf(other)[i];
    }
    if (!any) return false;  // metal everywhere: nothing to compare with
    for (int step = 0; step < kEdgePixels; ++step) circle = Widened(circle);
    uint8_t* const slice = SliceOf(static_cast<std::ptrdiff_t>(k));
    for (size_t i = 0; i < circle.size(); ++i) slice[i] &= circle[i];
    return true;
  }

 private:
  size_t NumPixels() const { return static_cast<size_t>(width_) * static_cast<size_t>(height_); }
  bool InStack(std::ptrdiff_t k) const {
    return k >= 0 && k < static_cast<std::ptrdiff_t>(has_streaks_.size());
  }
  uint8_t* SliceOf(std::ptrdiff_t k) {
    return filled_.data() + k * static_cast<std::ptrdiff_t>(NumPixels());
  }

  std::vector<uint8_t> Widened(const std::vector<uint8_t>& mask) const {
    std::vector<uint8_t> wide = mask;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        if (mask[Index(x, y)] == 0) continue;
        for (const auto& [dx, dy] : kSides) {
          const bool inside = x + dx >= 0 && y + dy >= 0 && x + dx < width_ && y + dy < height_;
          if (inside) wide[Index(x + dx, y + dy)] = 1;
        }
      }
    }
    return wide;
  }
  size_t Index(int x, int y) const {
    return static_cast<size_t>(x) + static_cast<size_t>(width_) * static_cast<size_t>(y);
  }

  int width_;
  int height_;
  std::vector<uint8_t>& filled_;
  std::vector<bool> has_streaks_;
};

// Whether tissue ends on it: a voxel of tissue lies within the rim that the field leaves out.
bool AddOutsideOf(const CylinderField& field, const CtVolume& volume,
                  std::vector<uint8_t>* unscanned) {
  CylinderField inner = field;
  inner.radius_mm -= 2 * volume.spacing_mm.maxCoeff();
  const std::vector<uint8_t> well_inside = CrossSectionOf(inner, volume);
  const std::vector<uint8_t> section = CrossSectionOf(field, volume);
  bool cuts = false;
  ForEachVoxelOfSection(field, volume, [&](size_t index, size_t at) {
    if (section[at] == 0) {
      (*unscanned)[index] = 1;
    } else if (well_inside[at] == 0 && volume.hu[index] > kTissueHu) {
      cuts = true;
    }
  });
  return cuts;
}

bool IsUpright(const CtVolume& volume) {
  const auto is_whole = [](double part) { return std::abs(part - std::round(part)) < kAskew; };
  return volume.slice_origins_mm.empty() &&
         std::all_of(volume.direction.reshaped().begin(), volume.direction.reshaped().end(),
                     is_whole);
}

}  // namespace

std::vector<uint8_t> FindUnscanned(const CtVolume& volume, int threads,
                                   const std::vector<uint8_t>& metal) {
  const size_t pixels = static_cast<size_t>(volume.size[0]) * static_cast<size_t>(volume.size[1]);
  std::vector<uint8_t> unscanned(volume.hu.size(), 0);
  std::vector<uint8_t> cuts_tissue(static_cast<size_t>(volume.size[2]), 0);
  const auto for_each_slice = [&](const auto& visit) {
    ParallelFor(threads, volume.size[2], 1, [&](Eigen::Index begin, Eigen::Index end) {
      for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
        visit(k, Slice(volume, static_cast<int>(k), unscanned.data() + pixels * k));
      }
    });
  };
  for_each_slice([&](size_t k, Slice slice) { cuts_tissue[k] = slice.Fill() ? 1 : 0; });
  if (!metal.empty()) {
    StreakFilter filter(volume, metal, &unscanned);
    for_each_slice([&](size_t k, const Slice& slice) {
      if (filter.Run(k)) cuts_tissue[k] = slice.TouchesTissue() ? 1 : 0;
    });
  }
  const bool field_cuts = volume.field && AddOutsideOf(*volume.field, volume, &unscanned);
  if (!field_cuts && std::find(cuts_tissue.begin(), cuts_tissue.end(), 1) == cuts_tissue.end())
    unscanned.clear();
  return unscanned;
}

absl::StatusOr<LabelGrid> ResampleUnscanned(const CtVolume& volume, double spacing_mm, int threads,
                                            const std::vector<uint8_t>& metal) {
  const std::vector<uint8_t> unscanned = FindUnscanned(volume, threads, metal);
  if (unscanned.empty() && IsUpright(volume)) return LabelGrid();
  // The mean over a voxel of the grid is the share of it that was scanned; air where there is no
  // volume.
  CtVolume scanned = volume;
  std::fill(scanned.hu.begin(), scanned.hu.end(), kWholly);
  for (size_t i = 0; i < unscanned.size(); ++i) {
    if (unscanned[i] != 0) scanned.hu[i] = 0;
  }
  absl::StatusOr<HuGrid> share = ResampleIsotropic(scanned, spacing_mm, {.threads = threads});
  if (!share.ok()) return share.status();
  LabelGrid grid(share->geometry);
  std::transform(share->values.begin(), share->values.end(), grid.values.begin(),
                 [](int16_t value) -> uint8_t { return value <= kWholly / 2 ? 1 : 0; });
  return grid;
}

}  // namespace tissueform
