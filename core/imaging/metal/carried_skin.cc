// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/carried_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/LU>

#include "core/base/parallel_for.h"
#include "core/imaging/metal/slice_stack.h"

namespace tissueform {
namespace {

constexpr int16_t kTissueHu = -500;
constexpr int16_t kSoftHu = 40;
constexpr int16_t kAirHu = -1000;
// Streaks reach beyond the slices with metal: the next one, or so far where slices are thin.
constexpr double kCleanBesideMm = 1.5;
// The outlines of lips bulge between slices that are far apart.
constexpr double kLeastToleranceMm = 4;
constexpr double kTolerancePerMm = 1;
constexpr double kStreakMm = 1.5;
constexpr double kHalfWidthMm = 5;
constexpr double kDeepestMm = 15;
constexpr double kNearMm = 4;
constexpr float kFar = 1e6F;
// Torn skin changes from slice to slice by so many times what clean slices beside it do. Simulated
// heads: 6 where it was torn, 0.8 and 1.0 with fillings and braces that leave it whole.
constexpr double kTornFactor = 2;
constexpr int kSlicesBeside = 4;

using Mask = std::vector<uint8_t>;
using Distances = std::vector<float>;

// Squared distances along one line from what has 0, by the lower envelope of parabolas
// (Felzenszwalb and Huttenlocher 2012). `step` is the distance of neighbors.
void SpreadAlongLine(float step, std::vector<float>* squares) {
  const std::vector<float>& from = *squares;
  const size_t count = from.size();
  std::vector<size_t> at(count);
  std::vector<float> begins(count + 1);
  size_t last = 0;
  begins[0] = -std::numeric_limits<float>::infinity();
  const auto crossing = [&](size_t a, size_t b) {
    const float xa = step * static_cast<float>(a);
    const float xb = step * static_cast<float>(b);
    return ((from[b] + xb * xb) - (from[a] + xa * xa)) / (2 * (xb - xa));
  };
  at[0] = 0;
  for (size_t q = 1; q < count; ++q) {
    while (last > 0 && crossing(at[last], q) <= begins[last]) --last;
    begins[last + 1] = crossing(at[last], q);
    at[++last] = q;
  }
  std::vector<float> result(count);
  size_t parabola = 0;
  for (size_t x = 0; x < count; ++x) {
    const float place = step * static_cast<float>(x);
    while (parabola < last && begins[parabola + 1] < place) ++parabola;
    const float off = place - step * static_cast<float>(at[parabola]);
    result[x] = off * off + from[at[parabola]];
  }
  *squares = std::move(result);
}

class Plane2d {
 public:
  explicit Plane2d(const SliceShape& shape) : shape_(shape) {}

  size_t size() const { return shape_.num_pixels(); }
  int width() const { return shape_.width; }
  int height() const { return shape_.height; }
  double pixel_mm() const { return std::max(shape_.pixel_width_mm, shape_.pixel_height_mm); }
  size_t Index(int x, int y) const {
    return static_cast<size_t>(x) + static_cast<size_t>(width()) * static_cast<size_t>(y);
  }

  // From the nearest pixel of the mask, in mm.
  Distances DistanceFrom(const Mask& mask) const {
    Distances squares(size());
    for (size_t i = 0; i < size(); ++i) squares[i] = mask[i] != 0 ? 0 : kFar;
    for (int y = 0; y < height(); ++y) {
      std::vector<float> line(squares.begin() + static_cast<std::ptrdiff_t>(Index(0, y)),
                              squares.begin() + static_cast<std::ptrdiff_t>(Index(0, y)) + width());
      SpreadAlongLine(static_cast<float>(shape_.pixel_width_mm), &line);
      std::copy(line.begin(), line.end(),
                squares.begin() + static_cast<std::ptrdiff_t>(Index(0, y)));
    }
    for (int x = 0; x < width(); ++x) {
      std::vector<float> line;
      line.reserve(static_cast<size_t>(height()));
      for (int y = 0; y < height(); ++y) line.push_back(squares[Index(x, y)]);
      SpreadAlongLine(static_cast<float>(shape_.pixel_height_mm), &line);
      for (int y = 0; y < height(); ++y) squares[Index(x, y)] = line[static_cast<size_t>(y)];
    }
    for (float& square : squares) square = std::sqrt(square);
    return squares;
  }

  // Positive inside; zero between the pixels of both sides.
  Distances SignedDistance(const Mask& inside) const {
    Mask outside(size());
    for (size_t i = 0; i < size(); ++i) outside[i] = inside[i] == 0 ? 1 : 0;
    const Distances to_inside = DistanceFrom(inside);
    Distances distance = DistanceFrom(outside);
    for (size_t i = 0; i < size(); ++i) distance[i] -= to_inside[i];
    return distance;
  }

  // What of the mask hangs together with the seeds over edges.
  Mask Connected(const Mask& mask, std::vector<size_t> seeds) const {
    Mask reached(size(), 0);
    for (const size_t seed : seeds) reached[seed] = 1;
    while (!seeds.empty()) {
      const size_t at = seeds.back();
      seeds.pop_back();
      const int x = static_cast<int>(at % static_cast<size_t>(width()));
      const int y = static_cast<int>(at / static_cast<size_t>(width()));
      for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= width() || y + dy >= height()) continue;
        const size_t to = Index(x + dx, y + dy);
        if (mask[to] == 0 || reached[to] != 0) continue;
        reached[to] = 1;
        seeds.push_back(to);
      }
    }
    return reached;
  }

  std::vector<size_t> Border() const {
    std::vector<size_t> border;
    for (int x = 0; x < width(); ++x)
      border.insert(border.end(), {Index(x, 0), Index(x, height() - 1)});
    for (int y = 0; y < height(); ++y)
      border.insert(border.end(), {Index(0, y), Index(width() - 1, y)});
    return border;
  }

  // The mask grown and shrunk again by a disc of kHalfWidthMm, without holes in it.
  Mask Closed(const Mask& mask) const {
    const Distances to_mask = DistanceFrom(mask);
    Mask beyond(size());
    for (size_t i = 0; i < size(); ++i) beyond[i] = to_mask[i] > kHalfWidthMm ? 1 : 0;
    const Distances to_beyond = DistanceFrom(beyond);
    Mask air(size());
    for (size_t i = 0; i < size(); ++i) air[i] = to_beyond[i] <= kHalfWidthMm ? 1 : 0;
    return Inverse(ReachedFromBorder(air));
  }
  // The mask shrunk and grown again.
  Mask Opened(const Mask& mask) const {
    const Distances depth = DistanceFrom(Inverse(mask));
    Mask cores(size());
    for (size_t i = 0; i < size(); ++i) cores[i] = depth[i] > kHalfWidthMm ? 1 : 0;
    const Distances to_cores = DistanceFrom(cores);
    Mask opened(size());
    for (size_t i = 0; i < size(); ++i) opened[i] = to_cores[i] <= kHalfWidthMm ? 1 : 0;
    return opened;
  }

  static Mask Inverse(const Mask& mask) {
    Mask rest(mask.size());
    for (size_t i = 0; i < rest.size(); ++i) rest[i] = mask[i] == 0 ? 1 : 0;
    return rest;
  }

  // What of the mask hangs together with the border of the slice.
  Mask ReachedFromBorder(const Mask& mask) const {
    std::vector<size_t> seeds;
    for (const size_t pixel : Border()) {
      if (mask[pixel] != 0) seeds.push_back(pixel);
    }
    return Connected(mask, std::move(seeds));
  }

 private:
  SliceShape shape_;
};

class SkinCarrier {
 public:
  SkinCarrier(const MetalFindings& findings, CtVolume* volume)
      : volume_(*volume), stack_(*volume), plane_(stack_.shape), metal_(findings.mask) {
    FindDirtySlices();
    LeaveWholeSkin();
  }

  CarriedSkin Run(int threads) {
    CarriedSkin carried;
    carried.mask.assign(volume_.hu.size(), 0);
    std::vector<std::array<int64_t, 2>> changed(static_cast<size_t>(stack_.slices));
    ParallelFor(threads, stack_.slices, 1, [&](Eigen::Index begin, Eigen::Index end) {
      for (auto slice = static_cast<int>(begin); slice < static_cast<int>(end); ++slice) {
        if (torn_[static_cast<size_t>(slice)]) {
          changed[static_cast<size_t>(slice)] = Carry(slice, &carried.mask);
        }
      }
    });
    const double voxel_mm3 = std::abs(volume_.StepsMm().determinant());
    for (const auto& [filled, removed] : changed) {
      if (filled + removed > 0) ++carried.slices;
      carried.filled_mm3 += voxel_mm3 * static_cast<double>(filled);
      carried.removed_mm3 += voxel_mm3 * static_cast<double>(removed);
    }
    if (carried.slices == 0) carried.mask.clear();
    return carried;
  }

 private:
  void FindDirtySlices() {
    const auto beside = static_cast<int>(std::ceil(kCleanBesideMm / stack_.slice_mm));
    dirty_.assign(static_cast<size_t>(stack_.slices), false);
    for (int slice = 0; slice < stack_.slices; ++slice) {
      if (!HasMetal(slice)) continue;
      const int last = std::min(stack_.slices - 1, slice + beside);
      for (int near = std::max(0, slice - beside); near <= last; ++near) {
        dirty_[static_cast<size_t>(near)] = true;
      }
    }
  }

  // Bands of slices whose skin is not torn are left as they are: carried over from afar it is
  // worse.
  void LeaveWholeSkin() {
    torn_.assign(dirty_.size(), false);
    for (int first = 0; first < stack_.slices; ++first) {
      if (!dirty_[static_cast<size_t>(first)]) continue;
      int last = first;
      while (last + 1 < stack_.slices && dirty_[static_cast<size_t>(last) + 1]) ++last;
      if (IsTorn(first, last)) {
        std::fill(torn_.begin() + first, torn_.begin() + last + 1, true);
      }
      first = last;
    }
  }

  // Whether neighbors differ more in a band of slices with metal than beside it.
  bool IsTorn(int first, int last) const {
    const int begin = std::max(0, first - 1 - kSlicesBeside);
    const int end = std::min(stack_.slices - 1, last + 1 + kSlicesBeside);
    std::array<double, 2> differing = {0, 0};  // pixels of clean pairs, of others
    std::array<int, 2> pairs = {0, 0};
    Mask head = HeadOf(TissueOf(begin));
    for (int slice = begin + 1; slice <= end; ++slice) {
      Mask next = HeadOf(TissueOf(slice));
      const bool is_dirty =
          dirty_[static_cast<size_t>(slice)] || dirty_[static_cast<size_t>(slice) - 1];
      for (size_t i = 0; i < next.size(); ++i) differing[is_dirty] += next[i] != head[i] ? 1 : 0;
      ++pairs[is_dirty];
      head = std::move(next);
    }
    if (pairs[0] == 0 || pairs[1] == 0) return false;
    return differing[1] / pairs[1] > kTornFactor * differing[0] / pairs[0];
  }

  bool HasMetal(int slice) const {
    bool any = false;
    ForEachPixel(slice, [&](size_t /*pixel*/, size_t voxel) { any |= metal_[voxel] != 0; });
    return any;
  }

  template <typename Visit>
  void ForEachPixel(int slice, const Visit& visit) const {
    size_t pixel = 0;
    for (int y = 0; y < plane_.height(); ++y) {
      for (int x = 0; x < plane_.width(); ++x, ++pixel) visit(pixel, stack_.Index(slice, x, y));
    }
  }

  Mask TissueOf(int slice) const {
    Mask tissue(plane_.size());
    ForEachPixel(slice, [&](size_t pixel, size_t voxel) {
      tissue[pixel] = volume_.hu[voxel] > kTissueHu ? 1 : 0;
    });
    return tissue;
  }

  // Tissue and the air that it encloses.
  Mask HeadOf(const Mask& tissue) const {
    return Plane2d::Inverse(plane_.ReachedFromBorder(Plane2d::Inverse(tissue)));
  }

  Distances OutlineOf(int slice) const { return plane_.SignedDistance(HeadOf(TissueOf(slice))); }

  int NextClean(int slice, int step) const {
    while (slice >= 0 && slice < stack_.slices && dirty_[static_cast<size_t>(slice)]) slice += step;
    return slice >= 0 && slice < stack_.slices ? slice : -1;
  }

  // Of the outline that the clean slices give, and the slice's own without what is narrow, where
  // two of three agree; no farther outside the first than the tolerance.
  Distances Target(const Mask& tissue, const Distances& carried, double tolerance_mm) const {
    const Mask head = HeadOf(tissue);
    const Distances first = plane_.SignedDistance(plane_.Opened(plane_.Closed(head)));
    const Distances second = plane_.SignedDistance(plane_.Closed(plane_.Opened(head)));
    Distances target(head.size());
    for (size_t i = 0; i < target.size(); ++i) {
      const auto [low, high] = std::minmax(first[i], second[i]);
      target[i] = std::min(std::clamp(carried[i], low, high),
                           carried[i] + static_cast<float>(tolerance_mm));
    }
    return target;
  }

  // How many voxels were filled and removed. It reads clean slices and its own: slices may run at
  // once.
  std::array<int64_t, 2> Carry(int slice, Mask* changed) {
    const int below = NextClean(slice, -1);
    const int above = NextClean(slice, 1);
    if (below < 0 || above < 0) return {0, 0};
    const Distances low = OutlineOf(below);
    const Distances high = OutlineOf(above);
    const float part = static_cast<float>(slice - below) / static_cast<float>(above - below);
    Distances carried(low.size());
    for (size_t i = 0; i < carried.size(); ++i) carried[i] = (1 - part) * low[i] + part * high[i];
    const double from_clean_mm = stack_.slice_mm * std::min(slice - below, above - slice);
    const Mask tissue = TissueOf(slice);
    const Distances depth =
        Target(tissue, carried, std::max(kLeastToleranceMm, kTolerancePerMm * from_clean_mm));
    Distances height = depth;
    for (float& mm : height) mm = -mm;
    const Mask dark = Streaks(Plane2d::Inverse(tissue), depth, kDeepestMm);
    const Mask bright = Streaks(tissue, height, kFar);
    return {Write(slice, dark, depth, changed), Write(slice, bright, depth, changed)};
  }

  // What of the mask lies at a positive depth, and reaches from near the outline to deeper than
  // kStreakMm.
  Mask Streaks(const Mask& mask, const Distances& depth, double deepest_mm) const {
    Mask inner(plane_.size());
    for (size_t i = 0; i < inner.size(); ++i) {
      inner[i] = mask[i] != 0 && depth[i] > 0 && depth[i] < deepest_mm ? 1 : 0;
    }
    const auto connected = [&](const Mask& of, double low_mm, double high_mm) {
      std::vector<size_t> seeds;
      for (size_t i = 0; i < of.size(); ++i) {
        if (of[i] != 0 && depth[i] > low_mm && depth[i] < high_mm) seeds.push_back(i);
      }
      return plane_.Connected(of, std::move(seeds));
    };
    return connected(connected(inner, kStreakMm, kFar), 0, kNearMm);
  }

  // Between air and tissue over a pixel on the carried skin.
  int64_t Write(int slice, const Mask& streaks, const Distances& depth, Mask* changed) {
    int64_t count = 0;
    ForEachPixel(slice, [&](size_t pixel, size_t voxel) {
      if (streaks[pixel] == 0 || metal_[voxel] != 0) return;
      const double inside = std::clamp(depth[pixel] / plane_.pixel_mm() + 0.5, 0.0, 1.0);
      volume_.hu[voxel] = static_cast<int16_t>(std::lround(kAirHu + inside * (kSoftHu - kAirHu)));
      (*changed)[voxel] = 1;
      ++count;
    });
    return count;
  }

  CtVolume& volume_;
  SliceStack stack_;
  Plane2d plane_;
  const std::vector<uint8_t>& metal_;
  std::vector<bool> dirty_;  // with metal, or next to it
  std::vector<bool> torn_;   // of these, those whose skin is torn
};

}  // namespace

CarriedSkin CarrySkinOver(const MetalFindings& findings, int threads, CtVolume* volume) {
  if (!findings.any()) return {};
  return SkinCarrier(findings, volume).Run(threads);
}

}  // namespace tissueform
