// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/slice_acquisitions.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "core/imaging/ct/regular_slices.h"

namespace tissueform {
namespace {

constexpr double kMaxOffPlace = 0.25;  // of the slices, where places alone decide
constexpr size_t kMaxScans = 8;
// Interleaved slices of one scan are taken within some seconds.
constexpr double kLaterS = 60;

// Which part of them each slice belongs to.
using Labels = std::vector<int>;

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
  if (label == 0 || label + 1 > static_cast<int>(kMaxScans)) return std::nullopt;
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
  std::string separated_by;
};

// Parts by one property after the other until the largest scan is as it should be.
class Separator {
 public:
  explicit Separator(const std::vector<DicomHeader>& slices) : slices_(slices) {
    const Eigen::Vector3d normal = SliceNormal(slices.front());
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
    TryText(&DicomHeader::frame_uid, "frame of reference");
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
  void TryText(std::string DicomHeader::*text, const std::string& separated_by) {
    Try(LabelsOf(slices_, [text](const DicomHeader& slice) { return slice.*text; }), separated_by);
  }

  void TryTime(Time time, const std::string& separated_by) {
    for (const double jump_s : LargestJumps(slices_, time)) {
      Try(LabelsOfJumps(slices_, time, jump_s), separated_by);
    }
  }

  void Try(const std::optional<Labels>& labels, const std::string& separated_by) {
    if (found_ || !labels) return;
    std::vector<Stack> scans = Assemble(stack_, *labels);
    if (scans.size() < 2 || scans.size() > kMaxScans || !IsRegular(scans.front())) return;
    found_ = Parting{std::move(scans), separated_by};
  }

  // Positions do not distinguish two slices at one place.
  void TryPlaces() {
    const std::vector<bool> in_it = OnRegularSteps(stack_);
    std::vector<Stack> scans(2);
    for (size_t i = 0; i < stack_.size(); ++i) {
      if (i > 0 && AreAtOnePlace(stack_[i - 1], stack_[i])) return;
      scans[in_it[i] ? 0 : 1].push_back(stack_[i]);
    }
    const auto off = static_cast<double>(scans[1].size());
    if (off > kMaxOffPlace * static_cast<double>(stack_.size())) return;
    found_ = Parting{std::move(scans), "place, off the even steps"};
  }

  const std::vector<DicomHeader>& slices_;
  Stack stack_;
  std::optional<Parting> found_;
};

bool HaveHeights(const std::vector<DicomHeader>& slices) {
  return std::all_of(slices.begin(), slices.end(), [](const DicomHeader& slice) {
    return slice.position_mm && slice.axes && slice.position_mm->allFinite() &&
           std::isfinite(slice.position_mm->squaredNorm()) && slice.axes->col(0).norm() < 2 &&
           slice.axes->col(1).norm() < 2;
  });
}

}  // namespace

std::vector<Acquisition> SeparateAcquisitions(std::vector<DicomHeader> slices) {
  std::optional<Parting> parting;
  if (slices.size() > 2 && HaveHeights(slices)) parting = Separator(slices).Separate();
  if (!parting) return {{std::move(slices), ""}};
  std::vector<Acquisition> acquisitions;
  for (const Stack& scan : parting->scans) {
    Acquisition acquisition{{}, parting->separated_by};
    for (const Placed& placed : scan) acquisition.slices.push_back(slices[placed.slice]);
    acquisitions.push_back(std::move(acquisition));
  }
  return acquisitions;
}

}  // namespace tissueform
