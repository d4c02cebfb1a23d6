// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/skin_places.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Attribute Labels(std::vector<uint8_t> labels) { return {"skin_region", 1, std::move(labels)}; }

TEST(SkinPlacesTest, LabelsBecomeNamedPlacesAndTheFaceIsAllOfThem) {
  ASSERT_OK_AND_ASSIGN(const auto places, SkinPlaces({Labels({3, 0, 4, 3, 0, 1})}));
  ASSERT_EQ(places.size(), 4U);
  EXPECT_THAT(FindPlace(places, "upper_lip")->vertices, ElementsAre(5));
  EXPECT_THAT(FindPlace(places, "chin")->vertices, ElementsAre(0, 3));
  EXPECT_THAT(FindPlace(places, "nose")->vertices, ElementsAre(2));
  EXPECT_THAT(FindPlace(places, "face")->vertices, ElementsAre(0, 2, 3, 5));
  EXPECT_EQ(FindPlace(places, "lower_lip"), nullptr);
}

TEST(SkinPlacesTest, PlacesComeInTheOrderOfTheirNumbersAndTheFaceLast) {
  ASSERT_OK_AND_ASSIGN(const auto places, SkinPlaces({Labels({6, 5, 4, 3, 2, 1, 0, 7})}));
  std::vector<std::string> names;
  names.reserve(places.size());
  for (const SkinPlace& place : places) names.push_back(place.name);
  EXPECT_THAT(names, ElementsAre("upper_lip", "lower_lip", "chin", "nose", "cheek_left",
                                 "cheek_right", "face"));
  EXPECT_THAT(places.back().vertices, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST(SkinPlacesTest, MeshWithoutTheArrayHasNoPlaces) {
  EXPECT_THAT(SkinPlaces({{"anatomy", 1, std::vector<uint8_t>{3, 3}}}).value(), IsEmpty());
  EXPECT_THAT(SkinPlaces({Labels({0, 0})}).value(), IsEmpty());
}

TEST(SkinPlacesTest, LabelsOfThreeComponentsAreRefused) {
  const absl::Status refused =
      SkinPlaces({{"skin_region", 3, std::vector<uint8_t>{1, 1, 1}}}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(refused));
  EXPECT_THAT(refused.message(), HasSubstr("\"skin_region\" has 3 components"));
}

TEST(SkinPlacesTest, ForemostIsTheFirstOfTheVerticesWithTheSmallestY) {
  const Positions positions{{0, -9, 0}, {5, -2, 0}, {0, -3, 7}, {0, 4, 0}, {1, -3, 0}};
  EXPECT_EQ(ForemostVertex(positions, {1, 2, 3, 4}), 2);
}

}  // namespace
}  // namespace tissueform
