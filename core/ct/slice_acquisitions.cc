// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/slice_acquisitions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

constexpr double kSamePlaceMm = 0.01;
// One chain may pass over so many slices at once; four of a later scan in one gap are many.
constexpr size_t kMostPassedOver = 8;
// What a change of step costs, in slices. One slice off its place makes three changes and is passed
// over (3 x 0.45 > 1); steps that all differ cost less than the slices are worth (0.45 < 1), so
// that uneven slices stay together; and so do thin slices between thick ones.
constexpr double kChangeOfStep = 0.45;
constexpr double kMostOffPlace = 0.25;  // of the slices, for places alone to tell
constexpr size_t kMostScans = 8;
// A gap that is so much wider than those about it lacks slices.
constexpr double kHole = 1.5;
// Interleaved slices of one scan are taken within some seconds.
constexpr double kLaterS = 60;

// A slice and where it lies.
struct Placed {
  double height_mm = 0;
  size_t slice = 0;
};
using Stack = std::vector<Placed>;  // rising

// Which part of them each slice belongs to.
using Labels = std::vector<int>;

Stack Sorted(Stack stack) {
  std::stable_sort(stack.begin(), stack.end(),
                   [](const Placed& a, const Placed& b) { return a.height_mm < b.height_mm; });
  return stack;
}

bool IsSameStep(double a, double b) {
  return std::abs(a - b) <= std::min(0.2, 0.2 * std::max(a, b));
}

// The longest chain of slices at regular steps, where a change of step costs kChangeOfStep: true
// for the slices in it. Of all slices where nothing is wrong. Dynamic programming over the last
// pair.
class RegularChain {
 public:
  explicit RegularChain(const Stack& stack) : stack_(stack), best_(stack.size()) {
    for (size_t end = 0; end < stack.size(); ++end) {
      for (size_t back = 1; back <= std::min(end, kMostPassedOver); ++back) Extend(end, back);
    }
  }

  std::vector<bool> InIt() const {
    std::vector<bool> in_it(stack_.size(), false);
    size_t end = 0;
    size_t back = 0;
    for (size_t e = 0; e < stack_.size(); ++e) {
      for (size_t b = 1; b <= kMostPassedOver; ++b) {
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
    for (size_t before = 1; before <= std::min(middle, kMostPassedOver); ++before) {
      if (best_[middle][before].score == 0) continue;
      const bool same = IsSameStep(Step(end, back), Step(middle, before));
      const double score = best_[middle][before].score + 1 - (same ? 0 : kChangeOfStep);
      if (score > best.score) best = {score, before};
    }
    best_[end][back] = best;
  }

  const Stack& stack_;
  std::vector<std::array<Best, kMostPassedOver + 1>> best_;
};

bool IsRegular(const Stack& stack) {
  if (stack.size() < 3)
    return stack.size() < 2 || stack[1].height_mm - stack[0].height_mm >= kSamePlaceMm;
  const std::vector<bool> in_it = RegularChain(stack).InIt();
  return std::all_of(in_it.begin(), in_it.end(), [](bool in) { return in; });
}

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

bool FitsInto(const Stack& part, const Stack& stack) {
  return std::all_of(part.begin(), part.end(),
                     [&stack](const Placed& placed) { return IsFree(placed.height_mm, stack); });
}

// Puts parts together that do not lie among each other, the largest first.
std::vector<Stack> Assemble(const Stack& stack, const Labels& labels) {
  std::map<int, Stack> by_label;
  for (const Placed& placed : stack) by_label[labels[placed.slice]].push_back(placed);
  std::vector<Stack> parts;
  parts.reserve(by_label.size());
  for (auto& [label, part] : by_label) parts.push_back(std::move(part));
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Stack& a, const Stack& b) { return a.size() > b.size(); });
  std::vector<Stack> scans;
  for (const Stack& part : parts) {
    const auto home = std::find_if(scans.begin(), scans.end(),
                                   [&part](const Stack& scan) { return FitsInto(part, scan); });
    if (home == scans.end()) {
      scans.push_back(part);
      continue;
    }
    home->insert(home->end(), part.begin(), part.end());
    *home = Sorted(std::move(*home));
  }
  std::stable_sort(scans.begin(), scans.end(),
                   [](const Stack& a, const Stack& b) { return a.size() > b.size(); });
  return scans;
}

// Numbers for what is equal; none where there is one part, or next to every slice is one.
template <typename Value>
std::optional<Labels> LabelsOf(const std::vector<DicomHeader>& slices, const Value& value) {
  std::map<decltype(value(slices.front())), int> numbers;
  Labels labels;
  for (const DicomHeader& slice : slices) {
    labels.push_back(
        numbers.try_emplace(value(slice), static_cast<int>(numbers.size())).first->second);
  }
  if (numbers.size() < 2 || 2 * numbers.size() > slices.size()) return std::nullopt;
  return labels;
}

using Time = std::optional<double> DicomHeader::*;

// Parts between which the time jumps by more than `jump_s`.
std::optional<Labels> LabelsOfJumps(const std::vector<DicomHeader>& slices, Time time,
                                    double jump_s) {
  std::vector<std::pair<double, size_t>> times;
  for (size_t i = 0; i < slices.size(); ++i) {
    if (!(slices[i].*time)) return std::nullopt;
    times.emplace_back(*(slices[i].*time), i);
  }
  std::sort(times.begin(), times.end());
  Labels labels(slices.size(), 0);
  int label = 0;
  for (size_t i = 1; i < times.size(); ++i) {
    label += times[i].first - times[i - 1].first > jump_s ? 1 : 0;
    labels[times[i].second] = label;
  }
  if (label == 0 || label + 1 > static_cast<int>(kMostScans)) return std::nullopt;
  return labels;
}

// The jumps of time, largest first, as limits between which parts are counted: at most three parts
// more.
std::vector<double> LargestJumps(const std::vector<DicomHeader>& slices, Time time) {
  std::vector<double> times;
  times.reserve(slices.size());
  for (const DicomHeader& slice : slices) times.push_back((slice.*time).value_or(0));
  std::sort(times.begin(), times.end());
  std::vector<double> jumps;
  for (size_t i = 1; i < times.size(); ++i) jumps.push_back(times[i] - times[i - 1]);
  std::sort(jumps.rbegin(), jumps.rend());
  jumps.resize(std::min<size_t>(jumps.size(), 3));
  jumps.erase(std::remove_if(jumps.begin(), jumps.end(), [](double jump) { return jump < 1; }),
              jumps.end());
  for (double& jump : jumps) jump -= 1e-6;
  return jumps;
}

struct Parting {
  std::vector<Stack> scans;
  std::string told_by;
};

// Parts by one property after the other until the largest scan is as it should be.
class Separator {
 public:
  explicit Separator(const std::vector<DicomHeader>& slices) : slices_(slices) {
    const DicomHeader& first = slices.front();
    const Eigen::Vector3d normal = first.row_direction->cross(*first.column_direction);
    for (size_t i = 0; i < slices.size(); ++i) {
      stack_.push_back({slices[i].position_mm->dot(normal), i});
    }
    stack_ = Sorted(std::move(stack_));
  }

  std::optional<Parting> Separate() {
    if (IsRegular(stack_)) {
      Try(LabelsOfJumps(slices_, &DicomHeader::acquisition_time_s, kLaterS), "acquisition time");
      return found_;
    }
    TryText(&DicomHeader::reconstruction, "reconstruction (kernel, voltage or phase)");
    Try(LabelsOfJumps(slices_, &DicomHeader::series_time_s, 0.5), "series time");
    TryText(&DicomHeader::study_uid, "study");
    TryText(&DicomHeader::frame_of_reference, "frame of reference");
    TryText(&DicomHeader::series_uid, "series");
    TryTime(&DicomHeader::acquisition_time_s, "acquisition time");
    TryTime(&DicomHeader::content_time_s, "content time");
    Try(LabelsOf(slices_,
                 [](const DicomHeader& slice) { return slice.acquisition_number.value_or(-1); }),
        "acquisition number");
    if (!found_) TryPlaces();
    return found_;
  }

 private:
  void TryText(std::string DicomHeader::*text, const std::string& told_by) {
    Try(LabelsOf(slices_, [text](const DicomHeader& slice) { return slice.*text; }), told_by);
  }

  void TryTime(Time time, const std::string& told_by) {
    for (const double jump_s : LargestJumps(slices_, time)) {
      Try(LabelsOfJumps(slices_, time, jump_s), told_by);
    }
  }

  void Try(const std::optional<Labels>& labels, const std::string& told_by) {
    if (found_ || !labels) return;
    std::vector<Stack> scans = Assemble(stack_, *labels);
    if (scans.size() < 2 || scans.size() > kMostScans || !IsRegular(scans.front())) return;
    found_ = Parting{std::move(scans), told_by};
  }

  // Two at one place cannot be told apart by it.
  void TryPlaces() {
    const std::vector<bool> in_it = RegularChain(stack_).InIt();
    std::vector<Stack> scans(2);
    for (size_t i = 0; i < stack_.size(); ++i) {
      if (i > 0 && stack_[i].height_mm - stack_[i - 1].height_mm < kSamePlaceMm) return;
      scans[in_it[i] ? 0 : 1].push_back(stack_[i]);
    }
    const auto off = static_cast<double>(scans[1].size());
    if (off > kMostOffPlace * static_cast<double>(stack_.size())) return;
    found_ = Parting{std::move(scans), "place, off the even steps"};
  }

  const std::vector<DicomHeader>& slices_;
  Stack stack_;
  std::optional<Parting> found_;
};

bool HaveHeights(const std::vector<DicomHeader>& slices) {
  return std::all_of(slices.begin(), slices.end(), [](const DicomHeader& slice) {
    return slice.position_mm && slice.row_direction && slice.position_mm->allFinite() &&
           std::isfinite(slice.position_mm->squaredNorm()) && slice.row_direction->norm() < 2 &&
           slice.column_direction->norm() < 2;
  });
}

}  // namespace

std::vector<Acquisition> SeparateAcquisitions(std::vector<DicomHeader> slices) {
  std::optional<Parting> parting;
  if (slices.size() > 2 && HaveHeights(slices)) parting = Separator(slices).Separate();
  if (!parting) return {{std::move(slices), ""}};
  std::vector<Acquisition> acquisitions;
  for (const Stack& scan : parting->scans) {
    Acquisition acquisition{{}, parting->told_by};
    for (const Placed& placed : scan) acquisition.slices.push_back(slices[placed.slice]);
    acquisitions.push_back(std::move(acquisition));
  }
  return acquisitions;
}

}  // namespace tissueform
