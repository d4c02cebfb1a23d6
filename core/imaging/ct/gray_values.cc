// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/gray_values.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/ct/cylinder_field.h"

namespace tissueform {
namespace {

constexpr int kLowestValue = std::numeric_limits<int16_t>::min();
constexpr size_t kNumValues = size_t{1} << 16;
constexpr size_t kNumBins = 256;
constexpr double kTailShare = 0.001;

constexpr double kAirHu = -1000;
constexpr double kSoftHu = 40;
// The mean of the third class in both helical CTs of a head that the project holds: 960 and 945.
constexpr double kHardHu = 930;
constexpr int16_t kUnscannedHu = -1024;

// (soft - air) / (hard - soft): 0.9 to 1.15 in fields 8 to 22 cm wide cut from two heads.
constexpr double kLeastRatio = 0.55;
constexpr double kMostRatio = 1.8;

// Of values that are HU, these classes lie within.
constexpr double kHighestAirHu = -700;
constexpr double kLowestSoftHu = -200;
constexpr double kHighestSoftHu = 300;

std::vector<int64_t> CountEachValue(const CtVolume& volume) {
  std::vector<int64_t> counts(kNumValues, 0);
  const auto add = [&](size_t index) {
    ++counts[static_cast<size_t>(volume.hu[index] - kLowestValue)];
  };
  if (volume.field) {
    const std::vector<uint8_t> section = CrossSectionOf(*volume.field, volume);
    ForEachVoxelOfSection(*volume.field, volume, [&](size_t index, size_t at) {
      if (section[at] != 0) add(index);
    });
  } else {
    for (size_t index = 0; index < volume.hu.size(); ++index) add(index);
  }
  return counts;
}

// The value under which that share of all lies.
int ValueAtShare(const std::vector<int64_t>& counts, int64_t all, double share) {
  int64_t sum = 0;
  for (size_t value = 0; value < counts.size(); ++value) {
    sum += counts[value];
    if (static_cast<double>(sum) > share * static_cast<double>(all)) {
      return static_cast<int>(value) + kLowestValue;
    }
  }
  return kLowestValue;
}

// Sums over the bins before each: of counts and of counts times value.
struct RunningSums {
  std::vector<double> count = {0};
  std::vector<double> moment = {0};

  explicit RunningSums(const GrayHistogram& histogram) {
    for (size_t bin = 0; bin < histogram.counts.size(); ++bin) {
      const auto voxels = static_cast<double>(histogram.counts[bin]);
      const double value = histogram.low + (static_cast<double>(bin) + 0.5) * histogram.bin_width;
      count.push_back(count.back() + voxels);
      moment.push_back(moment.back() + voxels * value);
    }
  }
  double Mean(size_t from, size_t to) const {
    return (moment[to] - moment[from]) / std::max(1.0, count[to] - count[from]);
  }
  // Of the variance between classes, the part of one.
  double Part(size_t from, size_t to) const {
    return (count[to] - count[from]) * Mean(from, to) * Mean(from, to);
  }
};

struct ThreeClasses {
  double air = 0;
  double soft = 0;
  double hard = 0;
  bool soft_is_larger = false;  // than the third class
};

ThreeClasses SplitInThree(const GrayHistogram& histogram) {
  const RunningSums sums(histogram);
  const size_t bins = histogram.counts.size();
  double best = -std::numeric_limits<double>::infinity();
  ThreeClasses classes;
  for (size_t first = 1; first + 1 < bins; ++first) {
    for (size_t second = first + 1; second < bins; ++second) {
      const double between =
          sums.Part(0, first) + sums.Part(first, second) + sums.Part(second, bins);
      if (between <= best) continue;
      best = between;
      classes = {sums.Mean(0, first), sums.Mean(first, second), sums.Mean(second, bins),
                 sums.count[second] - sums.count[first] > sums.count[bins] - sums.count[second]};
    }
  }
  return classes;
}

// From gray values to the scale of HU.
double ToHuScale(const GrayLevels& levels, double gray) {
  if (gray <= levels.soft) {
    return kAirHu + (gray - levels.air) * (kSoftHu - kAirHu) / (levels.soft - levels.air);
  }
  return kSoftHu + (gray - levels.soft) * (kHardHu - kSoftHu) / (levels.hard - levels.soft);
}

int16_t RoundedHu(const GrayLevels& levels, double gray) {
  constexpr double kHighest = std::numeric_limits<int16_t>::max();
  return static_cast<int16_t>(
      std::lround(std::clamp(ToHuScale(levels, gray), kUnscannedHu + 1.0, kHighest)));
}

void BringToHuScale(const GrayLevels& levels, CtVolume* volume) {
  std::vector<int16_t> table(kNumValues);
  for (size_t value = 0; value < table.size(); ++value) {
    table[value] = RoundedHu(levels, static_cast<double>(value) + kLowestValue);
  }
  for (int16_t& value : volume->hu) value = table[static_cast<size_t>(value - kLowestValue)];
}

void EmptyOutside(CtVolume* volume) {
  if (!volume->field) return;
  const std::vector<uint8_t> section = CrossSectionOf(*volume->field, *volume);
  ForEachVoxelOfSection(*volume->field, *volume, [&](size_t index, size_t at) {
    if (section[at] == 0) volume->hu[index] = kUnscannedHu;
  });
}

bool AreHuLevels(const GrayLevels& levels) {
  return levels.air <= kHighestAirHu && levels.soft >= kLowestSoftHu &&
         levels.soft <= kHighestSoftHu;
}

absl::Status TakeThresholds(const CtReadOptions& options, GrayLevels* levels) {
  levels->tissue_above = options.tissue_above_gray.value_or(levels->tissue_above);
  levels->bone_above = options.bone_above_gray.value_or(levels->bone_above);
  if (levels->air < levels->tissue_above && levels->tissue_above < levels->soft &&
      levels->soft < levels->bone_above) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "cannot use the CT: gray values are %.0f for air, %.0f for soft tissue and %.0f for bone, "
      "but "
      "the recipe sets tissue above %.0f and bone above %.0f; correct \"tissue_above_gray\" "
      "(between "
      "air and soft tissue) and \"bone_above_gray\" (over soft tissue)",
      levels->air, levels->soft, levels->hard, levels->tissue_above, levels->bone_above));
}

absl::Status CheckNoThresholds(const CtReadOptions& options) {
  if (!options.tissue_above_gray && !options.bone_above_gray) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "cannot use the CT: its values are HU, and \"tissue_above_gray\" and \"bone_above_gray\" are "
      "for gray values; use \"segmentation\" in the recipe, or state \"values\": \"gray\"");
}

std::string ReasonOf(const CtReadOptions& options, bool reader_says, bool gray) {
  if (options.values == CtValues::kHu) return "The recipe states that values are HU.";
  if (options.values == CtValues::kGray) return "The recipe states that values are gray values.";
  if (reader_says) return "The files state no calibration to HU, or their values are not HU.";
  if (gray) return "Air or soft tissue is not where it is in HU.";
  return "Air and soft tissue are where they are in HU.";
}

}  // namespace

GrayHistogram CountGrayValues(const CtVolume& volume) {
  const std::vector<int64_t> counts = CountEachValue(volume);
  int64_t all = 0;
  for (const int64_t count : counts) all += count;
  const int low = ValueAtShare(counts, all, kTailShare);
  const int high = ValueAtShare(counts, all, 1 - kTailShare) + 1;
  GrayHistogram histogram{.low = static_cast<double>(low),
                          .bin_width = std::max(1.0, static_cast<double>(high - low) / kNumBins),
                          .counts = std::vector<int64_t>(kNumBins, 0)};
  for (size_t value = 0; value < counts.size(); ++value) {
    const double bin =
        (static_cast<double>(value) + kLowestValue - histogram.low) / histogram.bin_width;
    histogram.counts[static_cast<size_t>(std::clamp(bin, 0.0, kNumBins - 1.0))] += counts[value];
  }
  return histogram;
}

absl::StatusOr<GrayLevels> FindGrayLevels(const GrayHistogram& histogram) {
  const ThreeClasses classes = SplitInThree(histogram);
  const double ratio = (classes.soft - classes.air) / (classes.hard - classes.soft);
  // Without bone the second class is only the blur between air and tissue.
  if (!(ratio >= kLeastRatio && ratio <= kMostRatio) || !classes.soft_is_larger) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "cannot use the CT: its gray values do not show air, soft tissue and bone: the classes of "
        "the histogram are %.0f, %.0f and %.0f, and in a head the middle one is half-way; the "
        "field "
        "of view must hold bone and soft tissue, or state \"hu_offset\" in the recipe",
        classes.air, classes.soft, classes.hard));
  }
  return GrayLevels{.air = classes.air,
                    .soft = classes.soft,
                    .hard = classes.hard,
                    .tissue_above = (classes.air + classes.soft) / 2,
                    .bone_above = (classes.soft + classes.hard) / 2};
}

absl::StatusOr<CtValuesReport> PrepareValues(const CtReadOptions& options, CtVolume* volume) {
  volume->field = FindCylinderField(*volume);
  CtValuesReport report;
  report.gray = volume->has_gray_values;
  report.field = volume->field;
  report.histogram = CountGrayValues(*volume);
  absl::StatusOr<GrayLevels> levels = FindGrayLevels(report.histogram);
  const bool decide = options.values == CtValues::kAuto && !volume->has_gray_values;
  // Without the three classes there is no scale to bring values to.
  if (decide && levels.ok()) report.gray = !AreHuLevels(*levels);
  report.reason = ReasonOf(options, volume->has_gray_values, report.gray);
  volume->has_gray_values = report.gray;
  if (!report.gray) {
    EmptyOutside(volume);
    TF_RETURN_IF_ERROR(CheckNoThresholds(options));
    return report;
  }
  TF_RETURN_IF_ERROR(levels.status());
  TF_RETURN_IF_ERROR(TakeThresholds(options, &*levels));
  report.levels = *levels;
  report.tissue_above_hu = RoundedHu(*levels, levels->tissue_above);
  report.bone_above_hu = RoundedHu(*levels, levels->bone_above);
  BringToHuScale(*levels, volume);
  EmptyOutside(volume);
  return report;
}

}  // namespace tissueform
