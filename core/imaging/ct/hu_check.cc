// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/hu_check.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"

#include "core/imaging/ct/cylinder_field.h"

namespace tissueform {
namespace {

constexpr int kLowest = -1024;
constexpr int kHighest = 32767;
constexpr int kBinWidth = 16;
constexpr size_t kNumBins = (kHighest - kLowest) / kBinWidth + 1;
// Single values do not show whether they are HU, but a body in air has a shape: some air below half
// of water's, some matter above fat's. A thousandth of the voxels is less than any head's share of
// either and more than a few damaged pixels.
constexpr int kAirBelow = -500;
constexpr int kMatterFrom = -200;
constexpr double kLeastShare = 0.001;

using HuHistogram = std::array<int64_t, kNumBins>;

size_t BinOf(int hu) { return static_cast<size_t>((std::max(hu, kLowest) - kLowest) / kBinWidth); }

HuHistogram Count(const std::vector<int16_t>& hu) {
  HuHistogram histogram{};
  for (const int16_t value : hu) ++histogram[BinOf(value)];
  return histogram;
}

double ShareBetween(const HuHistogram& histogram, int low, int high) {
  int64_t all = 0;
  int64_t inside = 0;
  for (size_t bin = 0; bin < kNumBins; ++bin) {
    all += histogram[bin];
    if (bin >= BinOf(low) && bin < BinOf(high)) inside += histogram[bin];
  }
  return all == 0 ? 0 : static_cast<double>(inside) / static_cast<double>(all);
}

// The value from `low` to `high` that is most frequent, to one bin.
int MostFrequent(const HuHistogram& histogram, int low, int high) {
  const auto first = histogram.begin() + static_cast<std::ptrdiff_t>(BinOf(low));
  const auto last = histogram.begin() + static_cast<std::ptrdiff_t>(BinOf(high)) + 1;
  const auto bin = std::max_element(first, last) - histogram.begin();
  return kLowest + static_cast<int>(bin) * kBinWidth;
}

// Stored values of most scanners are HU + 1024: air near 0, soft tissue (HU 0 to 100, the most
// frequent matter) near 1050. Then the message can give the offset; it is not applied by itself,
// because a guess of a unit must be the user's.
std::optional<int> TissueOfRawValues(const HuHistogram& histogram) {
  constexpr int kLeastTissueMode = 900;
  constexpr int kMaxTissueMode = 1200;
  constexpr int kMaxAirMode = 120;
  const int mode = MostFrequent(histogram, 500, 2000);
  const bool has_air = ShareBetween(histogram, -100, 300) > kLeastShare;
  const int air = MostFrequent(histogram, -500, 500);
  if (has_air && std::abs(air) <= kMaxAirMode && mode >= kLeastTissueMode && mode <= kMaxTissueMode)
    return mode;
  return std::nullopt;
}

absl::Status WithoutAir(const HuHistogram& histogram, std::optional<double> hu_offset) {
  if (const std::optional<int> mode = TissueOfRawValues(histogram); mode && !hu_offset) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the values are not HU: air lies near 0 and soft tissue near ", *mode,
        ", which looks like HU + 1024; add \"hu_offset\": -1024 to the recipe, or for a cone-beam "
        "CT \"values\": \"gray\""));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "the values are not HU of a body in air: almost none is below ", kAirBelow,
      hu_offset ? absl::StrCat(" after adding hu_offset ", *hu_offset, "; correct it in the recipe")
                : "; state \"hu_offset\" in the recipe"));
}

// Padding of -2000 beside HU + 1024 looks like air. But between true air and fat there are always
// voxels, partly filled, while raw values have their soft tissue about 1050 and next to nothing at
// 350 to 750, where every CT in HU has bone.
bool HidesRawValues(const HuHistogram& histogram) {
  const double tissue = ShareBetween(histogram, 850, 1250);
  return ShareBetween(histogram, -1000, kAirBelow) < kLeastShare &&
         ShareBetween(histogram, -100, 300) > kLeastShare && tissue > 0.02 &&
         tissue > 3 * ShareBetween(histogram, 350, 750);
}

// Of what the scanner has seen: around a cone-beam scanner's cylinder any value may be.
HuHistogram CountInField(const CtVolume& volume) {
  const std::optional<CylinderField> field = FindCylinderField(volume);
  if (!field) return Count(volume.hu);
  HuHistogram histogram{};
  const std::vector<uint8_t> section = CrossSectionOf(*field, volume);
  ForEachVoxelOfSection(*field, volume, [&](size_t index, size_t at) {
    if (section[at] != 0) ++histogram[BinOf(volume.hu[index])];
  });
  return histogram;
}

absl::Status CheckHistogram(const HuHistogram& histogram, std::optional<double> hu_offset) {
  if (ShareBetween(histogram, kLowest, kAirBelow) < kLeastShare || HidesRawValues(histogram)) {
    return WithoutAir(histogram, hu_offset);
  }
  if (ShareBetween(histogram, kMatterFrom, kHighest) < kLeastShare) {
    return absl::InvalidArgumentError(
        absl::StrCat("the values show only air: almost none is above ", kMatterFrom, " HU",
                     hu_offset ? absl::StrCat(" after adding hu_offset ", *hu_offset,
                                              "; correct it in the recipe or leave it out")
                               : "; if an offset was applied twice, state \"hu_offset\" in the "
                                 "recipe to undo one"));
  }
  return absl::OkStatus();
}

}  // namespace

int16_t ToStored(double value) {
  return static_cast<int16_t>(std::lround(std::clamp(value, -32768.0, double{kHighest})));
}

absl::Status CheckHu(const std::vector<int16_t>& hu, std::optional<double> hu_offset) {
  return CheckHistogram(Count(hu), hu_offset);
}

absl::Status SettleValues(const CtReadOptions& options, bool states_rescale, CtVolume* volume) {
  volume->has_gray_values = options.values == CtValues::kGray;
  if (volume->has_gray_values) return absl::OkStatus();
  const HuHistogram histogram = CountInField(*volume);
  const absl::Status are_hu = CheckHistogram(histogram, options.hu_offset);
  const bool may_be_gray = options.values == CtValues::kAuto && !options.hu_offset &&
                           ShareBetween(histogram, kMatterFrom, kHighest) >= kLeastShare &&
                           !TissueOfRawValues(histogram);
  if (!are_hu.ok() && may_be_gray) {
    volume->has_gray_values = true;
    return absl::OkStatus();
  }
  if (!are_hu.ok()) return are_hu;
  if (!states_rescale && !options.hu_offset) {
    volume->provenance.notes.emplace_back(
        "the files have no RescaleIntercept; their values are taken as HU, as they are those of a "
        "body in air");
  }
  for (int16_t& hu : volume->hu) hu = std::max(hu, int16_t{kLowest});
  return absl::OkStatus();
}

}  // namespace tissueform
