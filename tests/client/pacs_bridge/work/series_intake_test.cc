// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/series_intake.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;

class SeriesIntakeTest : public testing::BridgeWork {};

TEST_F(SeriesIntakeTest, ASeriesIsCompleteWhenNothingComesAnyMore) {
  const testing::CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, ASeriesIsCompleteAtOnceWhereThePacsCountsAsMany) {
  count_ = 8;
  const testing::CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving) << "its association is open";
  intake_->Ended({series.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, ASeriesThatStopsMidwayIsNotBuiltUntilTheRestCompletesIt) {
  count_ = 8;
  const testing::CtSeries series = Receive("a", {}, {6, 7});
  intake_->Ended({series.series_uid}, false);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
  for (const size_t i : {6, 7}) {
    fs::rename(root_ / ("a" + std::to_string(i)), series.files[i]);
    intake_->Arrived(series.files[i], *ReadInstanceHeader(series.files[i]));
  }
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, AMissingSliceIsSeenWhereNobodyCounts) {
  const testing::CtSeries series = Receive("a", {}, {4});
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(SeriesIntakeTest, AnAbortedAssociationLeavesNothingHalf) {
  const testing::CtSeries series = Receive("a", {}, {6, 7});
  intake_->Ended({series.series_uid}, false);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(SeriesIntakeTest, TheChoiceWaitsForAllSeriesOfTheStudy) {
  testing::CtSeriesOptions sharp;
  sharp.study_uid = "1.2.840.1";
  testing::CtSeriesOptions soft = sharp;
  soft.kernel = "H30s";
  const testing::CtSeries first = Receive("a", sharp);
  now_ += std::chrono::seconds(20);
  const testing::CtSeries second = Receive("b", soft);
  now_ += std::chrono::seconds(20);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kComplete);
  now_ += std::chrono::seconds(20);
  Settle();
  EXPECT_EQ(StateOf(first), SeriesState::kPassedOver);
  EXPECT_EQ(StateOf(second), SeriesState::kChosen);
}

TEST_F(SeriesIntakeTest, AChoiceIsToldOnce) {
  const testing::CtSeries series = Receive("a");
  WaitQuietly();
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> changed, intake_->Settle());
  ASSERT_EQ(StateOf(series), SeriesState::kChosen);
  EXPECT_EQ(changed.size(), 1);
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> again, intake_->Settle());
  EXPECT_TRUE(again.empty());
}

TEST_F(SeriesIntakeTest, TwoPatientsOfOneSeriesAreNobodys) {
  testing::CtSeriesOptions one;
  one.study_uid = "1.2.840.1";
  one.series_uid = "1.2.840.2";
  testing::CtSeriesOptions other = one;
  other.patient_id = "OTHER";
  const testing::CtSeries series = Receive("a", one);
  Receive("b", other);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kFailed);
  EXPECT_THAT(rows_.GetByUid(series.series_uid)->reason, Not(HasSubstr("OTHER")));
}

TEST_F(SeriesIntakeTest, AfterARestartWhatLiesThereIsTaken) {
  const fs::path folder = fs::path(queue_->received_folder()) / "a";
  fs::create_directories(folder);
  const testing::CtSeries series = testing::WriteCtSeries(folder);
  std::ofstream(folder / "x.partial") << "no image";
  ASSERT_THAT(intake_->Recover(), IsOk());
  Settle();
  EXPECT_EQ(rows_.GetByUid(series.series_uid)->images, 8);
}

}  // namespace
}  // namespace tissueform
