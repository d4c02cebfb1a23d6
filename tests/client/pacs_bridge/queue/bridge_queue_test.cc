// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/bridge_queue.h"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

class BridgeQueueTest : public ::testing::Test {
 protected:
  BridgeQueueTest()
      : folder_((EmptyTestFolder("bridge_queue") / "state").string()),
        queue_(*BridgeQueue::Open(folder_)) {}

  static QueuedStudy Study() {
    return {.uid = "1.2",
            .patient = {.id = "4711", .name = "Planted^Patricia", .birth_date = "19610203"},
            .date = "20260102",
            .description = "Head"};
  }
  static QueuedSeries Series() {
    QueuedSeries series;
    series.study_uid = "1.2";
    series.uid = "1.2.3";
    series.modality = "CT";
    return series;
  }
  static QueuedExport Export() {
    QueuedExport asked;
    asked.name = "exports/1";
    asked.key = NewQueueKey();
    asked.prediction = "predictions/1";
    asked.case_name = "cases/1";
    return asked;
  }

  const std::string folder_;
  std::unique_ptr<BridgeQueue> queue_;
};

TEST_F(BridgeQueueTest, IsAccessibleOnlyToItsOwner) {
  const auto others = fs::perms::group_all | fs::perms::others_all;
  EXPECT_EQ(fs::status(folder_).permissions() & others, fs::perms::none);
  EXPECT_EQ(fs::status(folder_ + "/queue.db").permissions() & others, fs::perms::none);
}

TEST_F(BridgeQueueTest, IsHeldByOneProcessAndReadableByOthers) {
  EXPECT_THAT(BridgeQueue::Open(folder_).status(), StatusIs(absl::StatusCode::kUnavailable));
  const auto reader = BridgeQueue::OpenForReading(folder_);
  ASSERT_THAT(reader, IsOk());
  ASSERT_THAT(ReceivedRows(queue_.get())
                  .Add(Study(), Series(), "k", {{.uid = "1", .class_uid = "c", .file = "f"}}),
              IsOk());
  EXPECT_EQ(ReceivedRows(reader->get()).List()->size(), 1);
}

TEST_F(BridgeQueueTest, RefusesAQueueOfANewerProgram) {
  ASSERT_THAT(
      queue_->Change([](Database& database) { return database.Execute("PRAGMA user_version=2"); }),
      IsOk());
  queue_.reset();
  EXPECT_THAT(BridgeQueue::Open(folder_).status(), StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(BridgeQueueTest, KeepsAllOfAChangeOrNothing) {
  EXPECT_FALSE(
      queue_
          ->Change([](Database& database) {
            database.Execute("INSERT INTO images VALUES ('k', 'u', 'c', 'f')").IgnoreError();
            return absl::InternalError("no");
          })
          .ok());
  EXPECT_TRUE(ReceivedRows(queue_.get()).ListImages("k")->empty());
}

TEST_F(BridgeQueueTest, KeepsARepeatedImageOnce) {
  ReceivedRows rows(queue_.get());
  const std::vector<QueuedImage> images = {{.uid = "1", .class_uid = "c", .file = "f1"},
                                           {.uid = "2", .class_uid = "c", .file = "f2"}};
  ASSERT_THAT(rows.Add(Study(), Series(), "first", images), IsOk());
  const auto again = rows.Add(Study(), Series(), "second", images);
  ASSERT_THAT(again, IsOk());
  EXPECT_EQ(again->key, "first");
  EXPECT_EQ(again->images, 2);
}

TEST_F(BridgeQueueTest, GoesOnWithASeriesThatHadStopped) {
  ReceivedRows rows(queue_.get());
  QueuedSeries series =
      *rows.Add(Study(), Series(), "k", {{.uid = "1", .class_uid = "c", .file = "f"}});
  series.state = SeriesState::kIncomplete;
  ASSERT_THAT(rows.Update(series), IsOk());
  EXPECT_EQ(rows.Add(Study(), Series(), "x", {{.uid = "1", .class_uid = "c", .file = "f"}})->state,
            SeriesState::kIncomplete)
      << "nothing new has come";
  EXPECT_EQ(rows.Add(Study(), Series(), "x", {{.uid = "2", .class_uid = "c", .file = "g"}})->state,
            SeriesState::kReceiving);
}

TEST_F(BridgeQueueTest, NewImageReopensOnlyASeriesWithoutABuiltPlan) {
  ReceivedRows rows(queue_.get());
  int image = 0;
  for (const auto& [state, after] : std::vector<std::pair<SeriesState, SeriesState>>{
           {SeriesState::kComplete, SeriesState::kReceiving},
           {SeriesState::kPassedOver, SeriesState::kReceiving},
           {SeriesState::kChosen, SeriesState::kReceiving},
           {SeriesState::kBuilt, SeriesState::kBuilt},
           {SeriesState::kPublished, SeriesState::kPublished},
           {SeriesState::kFailed, SeriesState::kFailed}}) {
    QueuedSeries series = *rows.Add(Study(), Series(), "k", {});
    series.state = state;
    ASSERT_THAT(rows.Update(series), IsOk());
    const std::string uid = std::to_string(++image);
    EXPECT_EQ(rows.Add(Study(), Series(), "k", {{.uid = uid, .class_uid = "c", .file = "f" + uid}})
                  ->state,
              after);
  }
}

TEST_F(BridgeQueueTest, DoesNotTakeAStepOfASeriesThatHasGrown) {
  ReceivedRows rows(queue_.get());
  QueuedSeries series =
      *rows.Add(Study(), Series(), "k", {{.uid = "1", .class_uid = "c", .file = "f"}});
  series.state = SeriesState::kChosen;
  ASSERT_THAT(rows.Update(series), IsOk());
  QueuedSeries built = series;
  built.state = SeriesState::kBuilt;
  ASSERT_THAT(rows.Add(Study(), Series(), "k", {{.uid = "2", .class_uid = "c", .file = "g"}}),
              IsOk());
  EXPECT_THAT(rows.UpdateStep(built, SeriesState::kChosen), StatusIs(absl::StatusCode::kAborted));
  ASSERT_THAT(rows.Update(series), IsOk());  // chosen again
  EXPECT_THAT(rows.UpdateStep(built, SeriesState::kChosen), StatusIs(absl::StatusCode::kAborted));
  built.images = 2;
  EXPECT_THAT(rows.UpdateStep(built, SeriesState::kChosen), IsOk());
  EXPECT_EQ(rows.Get("k")->state, SeriesState::kBuilt);
}

TEST_F(BridgeQueueTest, KnowsTheCasesOfEarlierPlans) {
  ReceivedRows rows(queue_.get());
  QueuedSeries series =
      *rows.Add(Study(), Series(), "k", {{.uid = "1", .class_uid = "c", .file = "f"}});
  for (const char* name : {"cases/1", "cases/2"}) {
    series.case_name = name;
    ASSERT_THAT(rows.Update(series), IsOk());
  }
  EXPECT_EQ(rows.GetByCase("cases/1")->key, "k");
  EXPECT_EQ(rows.GetByCase("cases/2")->key, "k");
  EXPECT_THAT(rows.GetByCase("cases/3").status(), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(rows.GetByCase("").status(), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(rows.ListSources("cases/1")->size(), 1);
  EXPECT_THAT(rows.Forget("k"), IsOk());
  EXPECT_THAT(rows.GetByCase("cases/1").status(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(BridgeQueueTest, RefusesASeriesOfTwoStudies) {
  ReceivedRows rows(queue_.get());
  ASSERT_THAT(rows.Add(Study(), Series(), "k", {}), IsOk());
  QueuedStudy other = Study();
  other.uid = "1.9";
  QueuedSeries series = Series();
  series.study_uid = "1.9";
  EXPECT_THAT(rows.Add(other, series, "l", {}).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(rows.GetStudy("1.9").status(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(BridgeQueueTest, AcceptsAConfirmationOnceAndOnlyForAWaitingExport) {
  ExportRows rows(queue_.get());
  EXPECT_THAT(rows.Confirm("exports/1", "d"), StatusIs(absl::StatusCode::kNotFound));
  ASSERT_THAT(rows.Add(Export()), IsOk());
  ASSERT_THAT(rows.Confirm("exports/1", "d"), IsOk());
  EXPECT_EQ(rows.Get("exports/1")->confirmed, "d");
  EXPECT_THAT(rows.Confirm("exports/1", "e"), StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(BridgeQueueTest, GivesAnObjectOnePermanentUid) {
  ExportRows rows(queue_.get());
  ASSERT_THAT(rows.Add(Export()), IsOk());
  const auto first = rows.EnsureObjects("exports/1", {"stl:skin", "report"}, NewDicomUid);
  ASSERT_THAT(first, IsOk());
  ASSERT_EQ(first->size(), 2);
  const auto again =
      rows.EnsureObjects("exports/1", {"report", "stl:skin", "capture"}, NewDicomUid);
  ASSERT_THAT(again, IsOk());
  ASSERT_EQ(again->size(), 3);
  EXPECT_EQ((*again)[1].uid, (*first)[0].uid);
  EXPECT_EQ((*again)[2].uid, (*first)[1].uid);
}

TEST(PatientIdentityTest, AnyChangeChangesTheDigest) {
  const PatientIdentity patient = {.id = "4711", .issuer = "i", .name = "n", .birth_date = "d"};
  EXPECT_EQ(DigestOf(patient), DigestOf(PatientIdentity(patient)));
  for (std::string PatientIdentity::*field :
       {&PatientIdentity::id, &PatientIdentity::issuer, &PatientIdentity::name,
        &PatientIdentity::birth_date}) {
    PatientIdentity other = patient;
    other.*field += "x";
    EXPECT_NE(DigestOf(patient), DigestOf(other));
  }
  PatientIdentity moved = patient;
  moved.id = "471";
  moved.issuer = "1i";
  EXPECT_NE(DigestOf(patient), DigestOf(moved)) << "fields are told apart";
  PatientIdentity unreadable = patient;
  unreadable.readable = false;
  EXPECT_NE(DigestOf(patient), DigestOf(unreadable));
}

}  // namespace
}  // namespace tissueform::testing
