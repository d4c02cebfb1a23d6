// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/skin_places.h"

#include <cstdint>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
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

TEST(SkinPlacesTest, MeshWithoutTheArrayHasNoPlaces) {
  EXPECT_THAT(SkinPlaces({{"anatomy", 1, std::vector<uint8_t>{3, 3}}}).value(), IsEmpty());
  EXPECT_THAT(SkinPlaces({Labels({0, 0})}).value(), IsEmpty());
}

TEST(SkinPlacesTest, LabelsOfThreeComponentsAreRefused) {
  EXPECT_TRUE(absl::IsInvalidArgument(
      SkinPlaces({{"skin_region", 3, std::vector<uint8_t>{1, 1, 1}}}).status()));
}

TEST(SkinPlacesTest, ForemostIsTheVertexOfThePlaceWithTheSmallestY) {
  const Positions positions{{0, -9, 0}, {5, -2, 0}, {0, -3, 7}, {0, 4, 0}};
  EXPECT_EQ(ForemostVertex(positions, {"chin", {1, 2, 3}}), 2);
}

}  // namespace
}  // namespace tissueform
