// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/moving_data.h"

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/file_bytes.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<CaseSurface> SmallSurfaces() {
  CaseSurface skin = {.name = "skin", .kind = SurfaceKind::kSkin};
  skin.positions.resize(4, 3);
  // 0.000244140625 is half a step.
  skin.positions << 0, 0, 0, 10.25F, -7.125F, 0.000244140625F, -120.3F, 3e-4F, -0.000244140625F,
      99.9F, -99.9F, 1.5F;
  skin.triangles.resize(2, 3);
  skin.triangles << 0, 1, 2, 2, 1, 3;
  skin.follows.emplace();
  skin.follows->vertices.resize(4, 3);
  skin.follows->vertices << 7, 3, 9, 3, 3, 3, 40, 9, 11, 5, 5, 5;
  skin.follows->weights.resize(4, 3);
  skin.follows->weights << 0.25F, 0.5F, 0.25F, 1, 0, 0, 0.3F, 0.3F, 0, 0, 0, 0;
  CaseSurface segment = {.name = "mandible", .kind = SurfaceKind::kSegment, .handle = "mandible"};
  segment.positions.resize(3, 3);
  segment.positions << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  segment.triangles.resize(1, 3);
  segment.triangles << 0, 1, 2;
  return {skin, segment};
}

MovingData SmallData() {
  MovingData data = {.title = "",
                     .software = "tissueform test",
                     .model = "linear_elastic",
                     .handle_is_free = {true, false}};
  CaseHandle mandible = {.name = "mandible", .label = "Lower jaw", .pivot_mm = {0.5, -40, 12}};
  mandible.pose.translation_mm = {0, -8, 0.25};
  mandible.pose.rotation_vector = {0.5, 0, 0};
  data.handles = {mandible, {.name = "maxilla", .label = "Upper jaw"}};
  data.surfaces = SmallSurfaces();
  FollowedVerticesOf(&data.surfaces);
  data.answers = "answer";
  return data;
}

std::string ReadGolden() { return BytesOfFile(SourcePath("tests/data/moving_file/small.bin")); }

TEST(MovingDataTest, TheBytesAreThoseThatThePlannerReads) {
  const std::string bytes = WriteMovingData(SmallData());
  if (const char* folder = std::getenv("TISSUEFORM_GOLDEN_MOVING_FILE")) {
    std::ofstream(std::string(folder) + "/small.bin", std::ios::binary) << bytes;
  }
  EXPECT_EQ(bytes, ReadGolden());
}

TEST(MovingDataTest, FollowedVerticesAreReindexedIntoACompactList) {
  std::vector<CaseSurface> surfaces = SmallSurfaces();
  // 11 and 5 have no weight.
  EXPECT_THAT(FollowedVerticesOf(&surfaces), ElementsAre(3, 7, 9, 40));
  const FollowedVertices& follows = *surfaces[0].follows;
  const std::vector<int32_t> places(follows.vertices.data(), follows.vertices.data() + 12);
  EXPECT_THAT(places, ElementsAre(1, 0, 2, 0, 0, 0, 3, 2, 0, 0, 0, 0));
  EXPECT_FALSE(surfaces[1].follows.has_value());
}

TEST(MovingDataTest, PartsBeginAtMultiplesOfSixteen) {
  MovingData data = SmallData();
  for (size_t extra = 0; extra < 20; ++extra) {
    data.title.push_back('x');
    EXPECT_EQ(WriteMovingData(data).size() % 16, 0U);
  }
}

TEST(MovingDataTest, HoldsOnlyTheListedPartsOfACase) {
  const std::string bytes = WriteMovingData(SmallData());
  for (const char* word : {"created", "plan_sha256", "commit", "meshes/", "landmark", "regions"}) {
    EXPECT_THAT(bytes, Not(HasSubstr(word)));
  }
  EXPECT_THAT(bytes, HasSubstr("not a medical device"));
}

}  // namespace
}  // namespace tissueform::testing
