// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/hu_check.h"

#include <algorithm>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

// 600 voxels of air, 300 of soft tissue, 100 of bone.
std::vector<int16_t> Head(int add) {
  std::vector<int16_t> hu(1000);
  for (int i = 0; i < 1000; ++i) {
    const int value = i < 600 ? -1000 + i % 30 : (i < 900 ? 20 + i % 60 : 700 + i % 500);
    hu[static_cast<size_t>(i)] = ToHu(value + add);
  }
  return hu;
}

TEST(HuCheckTest, NumbersAreRoundedAndBroughtIntoRange) {
  EXPECT_EQ(ToHu(12.4), 12);
  EXPECT_EQ(ToHu(-12.6), -13);
  EXPECT_EQ(ToHu(-1024.6), -1024);
  EXPECT_EQ(ToHu(-3024), -1024);
  EXPECT_EQ(ToHu(1e12), 32767);
}

TEST(HuCheckTest, HeadInAirIsAccepted) {
  EXPECT_THAT(CheckHu(Head(0), std::nullopt), IsOk());
  EXPECT_THAT(CheckHu(Head(0), -1024), IsOk());
}

TEST(HuCheckTest, RawValuesAreRecognisedAndTheOffsetNamed) {
  EXPECT_THAT(CheckHu(Head(1024), std::nullopt),
              StatusIs(kInvalid, AllOf(HasSubstr("looks like HU + 1024"),
                                       HasSubstr("\"hu_offset\": -1024"))));
  EXPECT_THAT(CheckHu(Head(1000), std::nullopt), StatusIs(kInvalid, HasSubstr("HU + 1024")));
}

TEST(HuCheckTest, PaddingDoesNotHideRawValues) {
  std::vector<int16_t> hu = Head(1024);
  hu.resize(1500, ToHu(-2000));
  EXPECT_THAT(CheckHu(hu, std::nullopt), StatusIs(kInvalid, HasSubstr("\"hu_offset\": -1024")));
  hu = Head(0);
  hu.resize(1500, ToHu(-2000));
  EXPECT_THAT(CheckHu(hu, std::nullopt), IsOk());
}

TEST(HuCheckTest, OtherValuesAreNotGuessedAt) {
  for (const int add : {600, 5000}) {
    EXPECT_THAT(CheckHu(Head(add), std::nullopt),
                StatusIs(kInvalid, HasSubstr("state \"hu_offset\"")));
  }
  EXPECT_THAT(CheckHu(Head(1024), 24), StatusIs(kInvalid, HasSubstr("hu_offset 24; correct it")));
  EXPECT_THAT(CheckHu(Head(-2048), -2048), StatusIs(kInvalid, HasSubstr("only air")));
  EXPECT_EQ(CheckHu({}, std::nullopt).code(), kInvalid);
}

}  // namespace
}  // namespace tissueform
