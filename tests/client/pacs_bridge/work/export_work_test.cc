// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_work.h"

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

class ExportWorkTest : public testing::BridgeWork {};

TEST_F(ExportWorkTest, AnExportGoesToThePacsAfterAPersonsWord) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_TRUE(Stored().empty());
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kTold);
  EXPECT_EQ(Stored().size(), 4);
  EXPECT_THAT(Updates(), Contains("exports/1 EXPORT_STATE_STORED 4 "));
  EXPECT_FALSE(fs::exists(queue_->object_folder(exports_.Get("exports/1")->key)));
}

TEST_F(ExportWorkTest, ABandThatCannotBeToldIsSaidAndTheReportGoesWithoutIt) {
  const testing::CtSeries series = ReceiveWithCase("a");
  server_->band = absl::InvalidArgumentError("ranges: 3 tets of 16");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kTold);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(
                             HasSubstr("without its band of uncertainty: ranges: 3 tets of 16")));
}

TEST_F(ExportWorkTest, ABandThatIsNotKnownIsNoReasonToWarn) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_TRUE(warnings_.empty());
}

TEST_F(ExportWorkTest, AServerWithoutRoomForABandIsAskedSomeTimesAndNotForever) {
  const testing::CtSeries series = ReceiveWithCase("a");
  server_->band = absl::ResourceExhaustedError("no memory");
  Ask("exports/1", series);
  Confirm("exports/1");
  for (int i = 0; i < 5; ++i) {
    EXPECT_THAT(Work("exports/1"), StatusIs(absl::StatusCode::kResourceExhausted));
  }
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kTold);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(HasSubstr("no memory")));
}

TEST_F(ExportWorkTest, APredictionOfAnotherMeshIsRefused) {
  const testing::CtSeries series = ReceiveWithCase("a");
  server_->mesh = "meshes/another";
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another mesh")));
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_TRUE(Stored().empty());
  EXPECT_THAT(Updates(), Contains(HasSubstr("FAILED 0 the prediction is of another mesh")));
}

TEST_F(ExportWorkTest, WhatIsDrawnOfAnExportThatHasFailedMeanwhileIsRemoved) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  const QueuedExport asked = *exports_.Get("exports/1");
  Confirm("exports/1");
  pacs_->headers.clear();
  EXPECT_FALSE(Work("exports/1").ok());
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_THAT(work_->Draw(asked), IsOk());
  EXPECT_FALSE(fs::exists(queue_->object_folder(asked.key)));
}

TEST_F(ExportWorkTest, ACaseOfAnotherBridgeIsLeftToIt) {
  v1::Export told;
  told.set_name("exports/1");
  told.set_case_("cases/unknown");
  told.set_state(v1::EXPORT_STATE_WAITING);
  EXPECT_THAT(work_->Take(told), IsOk());
  EXPECT_TRUE(exports_.List()->empty());
}

TEST_F(ExportWorkTest, APacsThatIsDownIsWaitedFor) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  pacs_->away = absl::UnavailableError("the PACS does not answer");
  for (int i = 0; i < 60; ++i) EXPECT_FALSE(Work("exports/1").ok());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kConfirmed);
  EXPECT_EQ(exports_.Get("exports/1")->attempts, 60);
  pacs_->away = absl::OkStatus();
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(ExportWorkTest, APacsThatDoesNotLetUsInMayDoSoLater) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  for (const absl::Status& refusal : {absl::UnauthenticatedError("the TLS handshake fails"),
                                      absl::PermissionDeniedError("calling AE title")}) {
    pacs_->away = refusal;
    EXPECT_EQ(Work("exports/1"), refusal);
    EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kConfirmed);
  }
  pacs_->away = absl::OkStatus();
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(ExportWorkTest, AStudyThatWasDeletedIsToldAndNothingIsStored) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  pacs_->headers.clear();
  EXPECT_THAT(Work("exports/1"), StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_TRUE(Stored().empty());
  EXPECT_THAT(Updates(), Contains(HasSubstr("FAILED 0 the PACS has the series of this case no")));
}

TEST_F(ExportWorkTest, AMergedPatientGoesBackToThePerson) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  testing::CtSeriesOptions merged;
  merged.study_uid = series.study_uid;
  merged.series_uid = series.series_uid;
  merged.patient_id = "MERGED-1";
  fs::create_directories(root_ / "merged");
  pacs_->headers[series.series_uid] =
      testing::WriteCtSeries(root_ / "merged", merged).files.front();
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_FALSE(
      fs::exists(fs::path(queue_->object_folder(exports_.Get("exports/1")->key)) / "header.dcm"));
  EXPECT_THAT(exports_.Get("exports/1")->note, HasSubstr("another patient ID"));
  EXPECT_THAT(exports_.Get("exports/1")->note, Not(HasSubstr("MERGED-1")));
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "MERGED-1");
  EXPECT_TRUE(Stored().empty());
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(ExportWorkTest, TwoStudiesAndTwoPatientsKeepTheirOwn) {
  testing::CtSeriesOptions other;
  other.patient_id = "OTHER";
  other.patient_name = "Other^Otto";
  const testing::CtSeries first = ReceiveWithCase("a");
  const testing::CtSeries again = ReceiveWithCase("b");
  const testing::CtSeries second = ReceiveWithCase("c", other);
  int number = 0;
  for (const testing::CtSeries& series : {first, again, second}) {
    const std::string name = absl::StrCat("exports/", ++number);
    Ask(name, series);
    Confirm(name);
    EXPECT_THAT(Work(name), IsOk());
  }
  ASSERT_EQ(Stored().size(), 12);
  std::map<std::string, std::set<std::string>> patients;
  for (const std::string& uid : Stored()) {
    const InstanceHeader header = *ReadInstanceHeader((root_ / "pacs" / uid).string());
    patients[header.study_uid].insert(header.patient_id);
  }
  EXPECT_THAT(patients[first.study_uid], ::testing::ElementsAre("PLANTED-4711"));
  EXPECT_THAT(patients[again.study_uid], ::testing::ElementsAre("PLANTED-4711"));
  EXPECT_THAT(patients[second.study_uid], ::testing::ElementsAre("OTHER"));
}

TEST_F(ExportWorkTest, NothingOutsideQueueImagesAndHeadersNamesThePatient) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  for (const fs::path& place : {root_ / "server", root_ / "state/plans"}) {
    for (const auto& file : fs::recursive_directory_iterator(place)) {
      if (!file.is_regular_file()) continue;
      std::ifstream stream(file.path(), std::ios::binary);
      const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
      for (const char* planted : {"Planted", "PLANTED", "19610203"}) {
        EXPECT_THAT(bytes, Not(HasSubstr(planted))) << file.path();
        EXPECT_THAT(file.path().string(), Not(HasSubstr(planted)));
      }
    }
  }
}

}  // namespace
}  // namespace tissueform
