// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/distance_transform.h"

#include <algorithm>
#include <vector>

#include "core/base/parallel_for.h"

namespace tissueform {
namespace {

// More than any square of a distance within a grid, with room to add one.
constexpr int32_t kFar = 1 << 30;

// So many neighbouring lines are taken together: the values that they have side by side are one
// line of the processor's cache.
constexpr Eigen::Index kLines = 16;

// Along x: distances to the nearest voxel of the mask in the same row, squared.
void SquareWithinRow(const uint8_t* mask, int size, int32_t* squares) {
  int32_t steps = -1;  // none met yet
  for (int x = 0; x < size; ++x) {
    steps = mask[x] != 0 ? 0 : steps < 0 ? -1 : steps + 1;
    squares[x] = steps < 0 ? kFar : steps * steps;
  }
  steps = -1;
  for (int x = size - 1; x >= 0; --x) {
    steps = mask[x] != 0 ? 0 : steps < 0 ? -1 : steps + 1;
    if (steps >= 0) squares[x] = std::min(squares[x], steps * steps);
  }
}

// One line of values f to the least of f(i) + (at - i)^2 over all i.
class LowerEnvelope {
 public:
  explicit LowerEnvelope(int size) : foot_(size), from_(size), value_(size) {}

  void Apply(int32_t* line, int size) {
    int last = -1;
    for (int at = 0; at < size; ++at) {
      if (line[at] >= kFar) continue;
      // A parabola that is above the new one where it would begin is nowhere the lowest.
      while (last >= 0 && Height(last, from_[last]) > line[at] + Square(from_[last] - at)) --last;
      const int from = last < 0 ? 0 : 1 + Crossing(last, at, line[at]);
      if (from >= size) continue;
      ++last;
      foot_[last] = at;
      value_[last] = line[at];
      from_[last] = from;
    }
    if (last < 0) return;
    for (int at = size - 1; at >= 0; --at) {
      line[at] = Height(last, at);
      if (at == from_[last]) --last;
    }
  }

 private:
  static int32_t Square(int32_t x) { return x * x; }
  int32_t Height(int parabola, int at) const {
    return value_[parabola] + Square(at - foot_[parabola]);
  }
  // The last place where the parabola is not above that of the value at a later place. Never
  // negative: at the parabola's own beginning it is not.
  int Crossing(int parabola, int at, int32_t value) const {
    const int foot = foot_[parabola];
    return (Square(at) - Square(foot) + value - value_[parabola]) / (2 * (at - foot));
  }

  // Of the parabolas of the envelope: where each has its foot, from where on it is the lowest.
  std::vector<int> foot_;
  std::vector<int> from_;
  std::vector<int32_t> value_;
};

// Along an axis whose neighbours are `stride` values apart: the lines that begin at `first` and the
// next `lines` values.
void ApplyToLines(int32_t* first, Eigen::Index lines, Eigen::Index stride, int size,
                  LowerEnvelope* envelope, std::vector<int32_t>* block) {
  block->resize(static_cast<size_t>(lines * size));
  for (int at = 0; at < size; ++at) {
    for (Eigen::Index k = 0; k < lines; ++k) (*block)[k * size + at] = first[at * stride + k];
  }
  for (Eigen::Index k = 0; k < lines; ++k) envelope->Apply(block->data() + k * size, size);
  for (int at = 0; at < size; ++at) {
    for (Eigen::Index k = 0; k < lines; ++k) first[at * stride + k] = (*block)[k * size + at];
  }
}

}  // namespace

VoxelGrid<int32_t> SquaredDistanceVoxels(const LabelGrid& mask, int threads) {
  const auto [nx, ny, nz] = mask.geometry.size;
  const Eigen::Index row = nx;
  const Eigen::Index slice = row * ny;
  VoxelGrid<int32_t> squares(mask.geometry);
  ParallelFor(threads, nz, 1, [&, ny = ny, nx = nx](Eigen::Index begin, Eigen::Index end) {
    LowerEnvelope envelope(ny);
    std::vector<int32_t> block;
    for (Eigen::Index z = begin; z < end; ++z) {
      int32_t* const first = squares.values.data() + z * slice;
      for (Eigen::Index y = 0; y < ny; ++y) {
        SquareWithinRow(mask.values.data() + z * slice + y * row, nx, first + y * row);
      }
      for (Eigen::Index x = 0; x < row; x += kLines) {
        ApplyToLines(first + x, std::min(kLines, row - x), row, ny, &envelope, &block);
      }
    }
  });
  ParallelFor(threads, slice, kLines, [&, nz = nz](Eigen::Index begin, Eigen::Index end) {
    LowerEnvelope envelope(nz);
    std::vector<int32_t> block;
    for (Eigen::Index at = begin; at < end; at += kLines) {
      ApplyToLines(squares.values.data() + at, std::min(kLines, end - at), slice, nz, &envelope,
                   &block);
    }
  });
  return squares;
}

}  // namespace tissueform
