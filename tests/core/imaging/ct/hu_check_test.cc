// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/hu_check.h"

#include <algorithm>
#include <utility>
#include <vector>

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
    hu[static_cast<size_t>(i)] = std::max(ToStored(value + add), int16_t{-1024});
  }
  return hu;
}

TEST(HuCheckTest, NumbersAreRoundedAndBroughtIntoRange) {
  EXPECT_EQ(ToStored(12.4), 12);
  EXPECT_EQ(ToStored(-12.6), -13);
  EXPECT_EQ(ToStored(-1e12), -32768);
  EXPECT_EQ(ToStored(1e12), 32767);
}

CtVolume VolumeOf(std::vector<int16_t> values) {
  CtVolume volume;
  volume.size = {10, 10, static_cast<int>(values.size()) / 100};
  volume.hu = std::move(values);
  return volume;
}

TEST(HuCheckTest, ValuesThatCannotBeHuAreGray) {
  CtVolume gray = VolumeOf(Head(3000));
  EXPECT_THAT(SettleValues({}, true, &gray), IsOk());
  EXPECT_TRUE(gray.has_gray_values);
  EXPECT_EQ(gray.hu, Head(3000));

  CtVolume hu = VolumeOf(Head(0));
  hu.hu[5] = -3000;
  EXPECT_THAT(SettleValues({}, true, &hu), IsOk());
  EXPECT_FALSE(hu.has_gray_values);
  EXPECT_EQ(hu.hu[5], -1024);
  EXPECT_TRUE(hu.provenance.notes.empty());
  EXPECT_THAT(SettleValues({}, false, &hu), IsOk());
  EXPECT_THAT(hu.provenance.notes.back(), HasSubstr("no RescaleIntercept"));
}

TEST(HuCheckTest, RecipeDecidesTheKindOfValues) {
  CtReadOptions options;
  options.values = CtValues::kHu;
  CtVolume volume = VolumeOf(Head(3000));
  EXPECT_THAT(SettleValues(options, true, &volume), StatusIs(kInvalid, HasSubstr("not HU")));
  options.values = CtValues::kGray;
  volume = VolumeOf(Head(0));
  EXPECT_THAT(SettleValues(options, true, &volume), IsOk());
  EXPECT_TRUE(volume.has_gray_values);
  // Raw values of a helical CT are more than gray values: the user is asked.
  volume = VolumeOf(Head(1024));
  EXPECT_THAT(SettleValues({}, true, &volume), StatusIs(kInvalid, HasSubstr("HU + 1024")));
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
  hu.resize(1500, ToStored(-2000));
  EXPECT_THAT(CheckHu(hu, std::nullopt), StatusIs(kInvalid, HasSubstr("\"hu_offset\": -1024")));
  hu = Head(0);
  hu.resize(1500, int16_t{-1024});
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
