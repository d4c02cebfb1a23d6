// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/skin_region.h"

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

TEST(SkinRegionTest, EveryRegionHasAName) {
  std::vector<std::string> names = {std::string(SkinRegionName(SkinRegion::kNone))};
  for (const SkinRegion region : kNamedSkinRegions) names.emplace_back(SkinRegionName(region));
  EXPECT_THAT(names, ElementsAre("none", "upper_lip", "lower_lip", "chin", "nose", "cheek_left",
                                 "cheek_right"));
}

TEST(SkinRegionTest, NumbersAreThoseOfTheRecipeFormat) {
  std::vector<int> numbers;
  numbers.reserve(kNamedSkinRegions.size());
  for (const SkinRegion region : kNamedSkinRegions) numbers.push_back(static_cast<int>(region));
  EXPECT_THAT(numbers, ElementsAre(1, 2, 3, 4, 5, 6));
}

}  // namespace
}  // namespace tissueform
