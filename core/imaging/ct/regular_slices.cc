// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/regular_slices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace tissueform {
namespace {

constexpr double kSamePlaceMm = 0.01;
// One chain may pass over so many slices at once; four of a later scan in one gap are many.
constexpr size_t kMaxPassedOver = 8;
// What a change of step costs, in slices. One slice off its place makes three changes and is passed
// over (3 x 0.45 > 1); steps that all differ cost less than the slices are worth (0.45 < 1), so
// that uneven slices stay together; and so do thin slices between thick ones.
constexpr double kChangeOfStep = 0.45;
// A gap that is so much wider than those about it lacks slices.
constexpr double kHole = 1.5;

bool IsSameStep(double a, double b) {
  return std::abs(a - b) <= std::min(0.2, 0.2 * std::max(a, b));
}

// Dynamic programming over the last pair of a chain.
class RegularChain {
 public:
  explicit RegularChain(const Stack& stack) : stack_(stack), best_(stack.size()) {
    for (size_t end = 0; end < stack.size(); ++end) {
      for (size_t back = 1; back <= std::min(end, kMaxPassedOver); ++back) Extend(end, back);
    }
  }

  std::vector<bool> InIt() const {
    std::vector<bool> in_it(stack_.size(), false);
    size_t end = 0;
    size_t back = 0;
    for (size_t e = 0; e < stack_.size(); ++e) {
      for (size_t b = 1; b <= kMaxPassedOver; ++b) {
        if (best_[e][b].score > best_[end][back].score) std::tie(end, back) = std::pair(e, b);
      }
    }
    while (back != 0) {
      in_it[end] = in_it[end - back] = true;
      const size_t before = best_[end][back].before;
      end -= back;
      back = before;
    }
    return in_it;
  }

 private:
  struct Best {
    double score = 0;   // of a chain that ends with the pair (end - back, end)
    size_t before = 0;  // back of the pair before it; 0 where it begins
  };

  double Step(size_t end, size_t back) const {
    return stack_[end].height_mm - stack_[end - back].height_mm;
  }

  void Extend(size_t end, size_t back) {
    if (Step(end, back) < kSamePlaceMm) return;
    const size_t middle = end - back;
    Best best{2, 0};
    for (size_t before = 1; before <= std::min(middle, kMaxPassedOver); ++before) {
      if (best_[middle][before].score == 0) continue;
      const bool same = IsSameStep(Step(end, back), Step(middle, before));
      const double score = best_[middle][before].score + 1 - (same ? 0 : kChangeOfStep);
      if (score > best.score) best = {score, before};
    }
    best_[end][back] = best;
  }

  const Stack& stack_;
  std::vector<std::array<Best, kMaxPassedOver + 1>> best_;
};

// Whether a place is free in a stack: outside of it, or in a hole.
bool IsFree(double height_mm, const Stack& stack) {
  const auto above = std::lower_bound(
      stack.begin(), stack.end(), height_mm,
      [](const Placed& placed, double height) { return placed.height_mm < height; });
  const auto upper = static_cast<size_t>(above - stack.begin());
  if (upper < stack.size() && stack[upper].height_mm - height_mm < kSamePlaceMm) return false;
  if (upper > 0 && height_mm - stack[upper - 1].height_mm < kSamePlaceMm) return false;
  if (upper == 0 || upper == stack.size()) return true;
  const auto gap = [&stack](size_t i) { return stack[i].height_mm - stack[i - 1].height_mm; };
  double usual = std::numeric_limits<double>::infinity();
  if (upper >= 2) usual = std::min(usual, gap(upper - 1));
  if (upper + 1 < stack.size()) usual = std::min(usual, gap(upper + 1));
  return gap(upper) > kHole * usual;
}

}  // namespace

Stack Sorted(Stack stack) {
  std::stable_sort(stack.begin(), stack.end(),
                   [](const Placed& a, const Placed& b) { return a.height_mm < b.height_mm; });
  return stack;
}

bool AreAtOnePlace(const Placed& lower, const Placed& upper) {
  return upper.height_mm - lower.height_mm < kSamePlaceMm;
}

std::vector<bool> OnRegularSteps(const Stack& stack) { return RegularChain(stack).InIt(); }

bool IsRegular(const Stack& stack) {
  if (stack.size() < 3) return stack.size() < 2 || !AreAtOnePlace(stack[0], stack[1]);
  const std::vector<bool> in_it = OnRegularSteps(stack);
  return std::all_of(in_it.begin(), in_it.end(), [](bool in) { return in; });
}

bool FitsInto(const Stack& part, const Stack& stack) {
  return std::all_of(part.begin(), part.end(),
                     [&stack](const Placed& placed) { return IsFree(placed.height_mm, stack); });
}

}  // namespace tissueform
