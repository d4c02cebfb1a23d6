// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/slice_groups.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

constexpr double kSameDirection = 1e-3;  // as in ArrangeStack
// Between two series that follow each other: this much of their larger usual distance.
constexpr double kLongestStep = 1.5;

using Fits = std::function<bool(const SliceGroup& a, const SliceGroup& b)>;

bool HasPlace(const DicomHeader& slice) {
  return slice.kind == DicomKind::kCtSlice && slice.position_mm && slice.axes &&
         slice.pixel_spacing_mm;
}

bool AreAlike(const DicomHeader& a, const DicomHeader& b) {
  return a.patient == b.patient && a.rows == b.rows && a.columns == b.columns &&
         HaveSameAxes(a, b) && a.pixel_spacing_mm->isApprox(*b.pixel_spacing_mm, kSameDirection) &&
         a.rescale_slope == b.rescale_slope && a.rescale_intercept == b.rescale_intercept &&
         a.patient_position == b.patient_position;
}

// A group that is not of one kind stays alone: ArrangeStack says what differs.
bool IsUniform(const SliceGroup& group) {
  const DicomHeader& first = group.slices.front();
  return HasPlace(first) &&
         std::all_of(group.slices.begin(), group.slices.end(), [&](const DicomHeader& slice) {
           return HasPlace(slice) && AreAlike(slice, first);
         });
}

bool HasPlaces(const SliceGroup& group) {
  return std::all_of(group.slices.begin(), group.slices.end(), HasPlace);
}

bool IsWhole(const SliceGroup& group) { return group.slices.size() >= kLeastSlices; }

bool AreOfOneImage(const SliceGroup& a, const SliceGroup& b) {
  return CanBeOneVolume(a, b) && a.slices.front().reconstruction == b.slices.front().reconstruction;
}

bool ShareFrame(const SliceGroup& a, const SliceGroup& b) {
  const std::string& frame = a.slices.front().frame_uid;
  return !frame.empty() && frame == b.slices.front().frame_uid;
}

std::vector<double> HeightsOf(const SliceGroup& group, const Eigen::Vector3d& normal) {
  std::vector<double> heights;
  for (const DicomHeader& slice : group.slices) heights.push_back(slice.position_mm->dot(normal));
  std::sort(heights.begin(), heights.end());
  return heights;
}

double UsualStep(const std::vector<double>& heights) {
  std::vector<double> steps;
  for (size_t i = 1; i < heights.size(); ++i) steps.push_back(heights[i] - heights[i - 1]);
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

bool FollowEachOther(const SliceGroup& a, const SliceGroup& b) {
  const Eigen::Vector3d normal = SliceNormal(a.slices.front());
  const std::vector<double> of_a = HeightsOf(a, normal);
  const std::vector<double> of_b = HeightsOf(b, normal);
  const double between = std::max(of_b.front() - of_a.back(), of_a.front() - of_b.back());
  return between > 0 && between <= kLongestStep * std::max(UsualStep(of_a), UsualStep(of_b));
}

void Join(SliceGroup* other, SliceGroup* into) {
  std::move(other->slices.begin(), other->slices.end(), std::back_inserter(into->slices));
  into->num_series += other->num_series;
}

// Puts each group into the first of those before it that it fits, again and again until none does.
void JoinThoseThat(const Fits& fit, std::vector<SliceGroup>* groups) {
  std::vector<SliceGroup> joined;
  for (SliceGroup& group : *groups) {
    const auto into = std::find_if(joined.begin(), joined.end(),
                                   [&](const SliceGroup& other) { return fit(other, group); });
    if (into == joined.end()) {
      joined.push_back(std::move(group));
    } else {
      Join(&group, &*into);
    }
  }
  const bool goes_on = joined.size() < groups->size();
  *groups = std::move(joined);
  if (goes_on) JoinThoseThat(fit, groups);
}

// A fragment that fits several whole groups (two phases) may belong to any of them: it stays alone.
void AddFragments(std::vector<SliceGroup>* whole, std::vector<SliceGroup>* fragments) {
  std::vector<SliceGroup> left;
  for (SliceGroup& fragment : *fragments) {
    std::vector<SliceGroup*> homes;
    for (SliceGroup& group : *whole) {
      if (AreOfOneImage(group, fragment) && ShareFrame(group, fragment)) homes.push_back(&group);
    }
    if (homes.size() == 1) {
      Join(&fragment, homes.front());
    } else {
      left.push_back(std::move(fragment));
    }
  }
  *fragments = std::move(left);
}

void SortByNumber(std::vector<SliceGroup>* groups) {
  // Identifiers of series are random: numbers and names of files give the order.
  std::sort(groups->begin(), groups->end(), [](const SliceGroup& a, const SliceGroup& b) {
    const DicomHeader& of_a = a.slices.front();
    const DicomHeader& of_b = b.slices.front();
    return std::tuple(of_a.series_number, of_a.file_number, of_a.frame) <
           std::tuple(of_b.series_number, of_b.file_number, of_b.frame);
  });
}

// Takes out of the groups those for which the condition holds.
template <typename Condition>
std::vector<SliceGroup> Take(const Condition& condition, std::vector<SliceGroup>* groups) {
  const auto first = std::stable_partition(groups->begin(), groups->end(),
                                           [&](const SliceGroup& g) { return !condition(g); });
  std::vector<SliceGroup> taken;
  std::move(first, groups->end(), std::back_inserter(taken));
  groups->erase(first, groups->end());
  return taken;
}

void JoinAsTheyFit(std::vector<SliceGroup>* groups) {
  std::vector<SliceGroup> whole = Take(IsWhole, groups);
  JoinThoseThat(
      [](const SliceGroup& a, const SliceGroup& b) {
        return AreOfOneImage(a, b) && ShareFrame(a, b) &&
               a.slices.front().study_uid == b.slices.front().study_uid && FollowEachOther(a, b);
      },
      &whole);
  AddFragments(&whole, groups);
  JoinThoseThat([](const SliceGroup& a,
                   const SliceGroup& b) { return AreOfOneImage(a, b) && ShareFrame(a, b); },
                groups);
  for (SliceGroup& group : Take(IsWhole, groups)) whole.push_back(std::move(group));
  JoinThoseThat(AreOfOneImage, groups);
  for (SliceGroup& group : whole) groups->push_back(std::move(group));
}

}  // namespace

std::vector<SliceGroup> GroupBySeries(const std::vector<DicomHeader>& files) {
  std::map<std::tuple<std::string, std::string, std::optional<int>>, SliceGroup> by_series;
  for (const DicomHeader& file : files) {
    if (file.kind == DicomKind::kDirectory) continue;
    by_series[{file.patient, file.series_uid, file.series_number}].slices.push_back(file);
  }
  std::vector<SliceGroup> groups;
  groups.reserve(by_series.size());
  for (auto& [name, group] : by_series) groups.push_back(std::move(group));
  SortByNumber(&groups);
  return groups;
}

bool HaveSameAxes(const DicomHeader& a, const DicomHeader& b) {
  return (*a.axes - *b.axes).colwise().norm().maxCoeff() <= kSameDirection;
}

bool CanBeOneVolume(const SliceGroup& a, const SliceGroup& b) {
  return HasPlace(a.slices.front()) && HasPlace(b.slices.front()) &&
         AreAlike(a.slices.front(), b.slices.front());
}

bool AreApart(const SliceGroup& a, const SliceGroup& b) {
  if (!HasPlaces(a) || !HasPlaces(b)) return false;
  const std::vector<double> of_a = HeightsOf(a, SliceNormal(a.slices.front()));
  const std::vector<double> of_b = HeightsOf(b, SliceNormal(a.slices.front()));
  return of_a.back() < of_b.front() || of_b.back() < of_a.front();
}

std::vector<SliceGroup> JoinGroups(std::vector<SliceGroup> groups, JoinSeries join) {
  if (join == JoinSeries::kNever) return groups;
  std::vector<SliceGroup> uniform = Take(IsUniform, &groups);
  if (join == JoinSeries::kAlways) JoinThoseThat(CanBeOneVolume, &uniform);
  if (join == JoinSeries::kAuto) JoinAsTheyFit(&uniform);
  for (SliceGroup& group : uniform) groups.push_back(std::move(group));
  for (SliceGroup& group : groups) {
    std::sort(group.slices.begin(), group.slices.end(),
              [](const DicomHeader& a, const DicomHeader& b) {
                return std::pair(a.file_number, a.frame) < std::pair(b.file_number, b.frame);
              });
  }
  SortByNumber(&groups);
  return groups;
}

}  // namespace tissueform
