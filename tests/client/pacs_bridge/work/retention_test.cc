// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/retention.h"

#include <ctime>
#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

class RetentionTest : public BridgeWork {};

// Seconds of the clock that files have.
int64_t DaysFromNow(int64_t days) { return std::time(nullptr) + days * 24 * 3600; }

TEST_F(RetentionTest, ImagesAreDeletedWhenTheirTimeIsOverAndTheCaseStays) {
  const CtSeries series = ReceiveWithCase("a");
  const RetentionOptions options;
  EXPECT_EQ(*DeleteOld(queue_.get(), options, 1'000'000 + 6 * 24 * 3600), 0);
  EXPECT_TRUE(fs::exists(series.files.front()));
  EXPECT_EQ(*DeleteOld(queue_.get(), options, 1'000'000 + 8 * 24 * 3600), 1);
  EXPECT_FALSE(fs::exists(series.files.front()));
  const QueuedSeries kept = *rows_.GetByUid(series.series_uid);
  EXPECT_FALSE(kept.has_files);
  EXPECT_TRUE(kept.has_header);
  EXPECT_EQ(rows_.ListImages(kept.key)->size(), 8) << "what is written later refers to them";
  EXPECT_EQ(*DeleteOld(queue_.get(), options, 1'000'000 + 91 * 24 * 3600), 1);
  EXPECT_FALSE(fs::exists(queue_->header_path(kept.key)));
}

TEST_F(RetentionTest, ForgetsAPatientWithoutACaseTogetherWithTheHeaders) {
  const CtSeries series = Receive("a", {}, {4});
  WaitQuietly();
  Settle();
  ASSERT_EQ(StateOf(series), SeriesState::kIncomplete);
  const RetentionOptions options;
  EXPECT_EQ(*DeleteOld(queue_.get(), options, DaysFromNow(8)), 1);
  EXPECT_THAT(rows_.GetStudy(series.study_uid), IsOk());
  EXPECT_EQ(*DeleteOld(queue_.get(), options, DaysFromNow(91)), 1);
  EXPECT_THAT(rows_.GetStudy(series.study_uid), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_TRUE(rows_.List()->empty());
}

TEST_F(RetentionTest, RemembersAPatientWithACase) {
  const CtSeries series = ReceiveWithCase("a");
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(1000)), IsOk());
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "PLANTED-4711");
}

TEST_F(RetentionTest, DeletesAFileOfNoSeriesAfterItsRetention) {
  CtSeriesOptions one;
  one.study_uid = "1.2.840.1";
  one.series_uid = "1.2.840.2";
  CtSeriesOptions other = one;
  other.study_uid = "1.2.840.3";
  Receive("a", one);
  Settle();
  const CtSeries stranger = Receive("b", other);
  Settle();
  EXPECT_EQ(*DeleteOld(queue_.get(), {}, DaysFromNow(6)), 0);
  EXPECT_TRUE(fs::exists(stranger.files.front()));
  // Its eight files, and the series, which has failed by it.
  EXPECT_EQ(*DeleteOld(queue_.get(), {}, DaysFromNow(8)), 9);
  EXPECT_FALSE(fs::exists(stranger.files.front()));
}

TEST_F(RetentionTest, KeepsAnOldSeriesWhileNewImagesArrive) {
  const CtSeries series = Receive("a", {}, {4});
  WaitQuietly();
  Settle();
  ASSERT_EQ(StateOf(series), SeriesState::kIncomplete);
  fs::rename(root_ / "a4", series.files[4]);
  intake_->Arrived(series.files[4], *ReadInstanceHeader(series.files[4]));
  Settle();
  ASSERT_EQ(StateOf(series), SeriesState::kReceiving);
  EXPECT_EQ(*DeleteOld(queue_.get(), {}, DaysFromNow(8)), 0);
  EXPECT_TRUE(fs::exists(series.files.front()));
}

TEST_F(RetentionTest, UnconfirmedExportFailsAndItsPicturesAreRemoved) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  ASSERT_THAT(work_->Draw(*exports_.Get("exports/1")), IsOk());
  const fs::path folder = queue_->object_folder(exports_.Get("exports/1")->key);
  ASSERT_TRUE(fs::exists(folder / "pictures"));
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(13)), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(15)), IsOk());
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_THAT(Updates(), ::testing::Contains(::testing::HasSubstr(
                             "FAILED 0 the patient was not confirmed for 14 days")));
  EXPECT_FALSE(fs::exists(folder));
}

TEST_F(RetentionTest, KeepsTheOutcomeOfAnExportForItsRetention) {
  const CtSeries series = ReceiveWithCase("a");
  for (const char* name : {"exports/1", "exports/2"}) {
    Ask(name, series);
    Confirm(name);
  }
  EXPECT_THAT(Work("exports/1"), IsOk());
  pacs_->headers.clear();
  EXPECT_FALSE(Work("exports/2").ok());
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(31)), IsOk());
  EXPECT_THAT(exports_.Get("exports/1"), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_TRUE(exports_.ListObjects("exports/1")->empty());
  EXPECT_EQ(StateOfExport("exports/2"), BridgeExportState::kFailed) << "which the server must know";
  EXPECT_THAT(Work("exports/2"), IsOk());
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(29)), IsOk());
  EXPECT_THAT(exports_.Get("exports/2"), IsOk());
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(31)), IsOk());
  EXPECT_TRUE(exports_.List()->empty());
}

}  // namespace
}  // namespace tissueform::testing
