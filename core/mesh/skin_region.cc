// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/skin_region.h"

namespace tissueform {

absl::string_view SkinRegionName(SkinRegion region) {
  constexpr std::array<absl::string_view, 7> kNames = {"none", "upper_lip",  "lower_lip",  "chin",
                                                       "nose", "cheek_left", "cheek_right"};
  return kNames[static_cast<size_t>(region)];
}

}  // namespace tissueform
