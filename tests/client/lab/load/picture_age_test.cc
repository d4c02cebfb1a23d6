// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/picture_age.h"

#include <algorithm>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

TEST(PictureAges, GrowUntilANewerPoseIsShown) {
  // Sent at 100 and 120; shown at 115 and 145.
  const std::vector<ShownFrame> frames = {{100, 115}, {120, 145}};
  EXPECT_THAT(PictureAges(100, 160, frames), ElementsAre(0, 10, 20, 30, 40, 30, 40));
}

TEST(PictureAges, CountFromTheFirstPoseWhileNothingIsShown) {
  EXPECT_THAT(PictureAges(50, 80, {}), ElementsAre(0, 10, 20, 30));
}

TEST(PictureAges, AreNotMadeYoungerByAnOldPoseThatIsShownLate) {
  const std::vector<ShownFrame> frames = {{20, 25}, {10, 35}};
  EXPECT_THAT(PictureAges(0, 40, frames), ElementsAre(0, 10, 20, 10, 20));
}

TEST(PictureAges, RevealDroppedPosesThatLatencyHides) {
  // One pose in ten is answered, each 5 ms after it was sent: every latency is 5 ms.
  std::vector<ShownFrame> frames;
  frames.reserve(10);
  for (int i = 0; i < 10; ++i) frames.push_back({i * 330.0, i * 330.0 + 5});
  const std::vector<double> ages = PictureAges(0, 3000, frames);
  EXPECT_GT(*std::max_element(ages.begin(), ages.end()), 320);
}

}  // namespace
}  // namespace tissueform
