// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>

#include "absl/strings/string_view.h"

namespace tissueform {

// Named parts of a face's skin, by the numbers of the point array "skin_region".
enum class SkinRegion : uint8_t {
  kNone = 0,
  kUpperLip = 1,
  kLowerLip = 2,
  kChin = 3,
  kNose = 4,
  kLeftCheek = 5,  // of the patient
  kRightCheek = 6,
};

// All but kNone, in the order of their numbers.
inline constexpr std::array<SkinRegion, 6> kNamedSkinRegions = {
    SkinRegion::kUpperLip, SkinRegion::kLowerLip,  SkinRegion::kChin,
    SkinRegion::kNose,     SkinRegion::kLeftCheek, SkinRegion::kRightCheek};

// "none", "upper_lip", "lower_lip", "chin", "nose", "cheek_left", "cheek_right".
absl::string_view SkinRegionName(SkinRegion region);

}  // namespace tissueform
