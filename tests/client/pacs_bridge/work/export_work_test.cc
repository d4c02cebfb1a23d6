// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_work.h"

#include <chrono>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/retention.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "core/case_file/case_writer.h"
#include "tests/client/pacs_bridge/work/bridge_world.h"
#include "tests/core/case_file/sample_case.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

SeriesRule SmallRule() {
  SeriesRule rule;
  rule.recipe = "recipe.json";
  rule.min_slices = 8;
  rule.max_spacing_mm = 10;
  rule.max_thickness_mm = 10;
  rule.min_coverage_mm = 0;
  return rule;
}

// A bridge in folders, with a clock that stands.
class BridgeWorkTest : public ::testing::Test {
 protected:
  BridgeWorkTest()
      : root_(testing::EmptyTestFolder("bridge_work")),
        queue_(*BridgeQueue::Open((root_ / "state").string())),
        rows_(queue_.get()),
        exports_(queue_.get()) {
    fs::create_directories(root_ / "server");
    fs::create_directories(root_ / "pacs");
    server_ = std::make_unique<testing::FolderCaseServer>(root_ / "server");
    pacs_ = std::make_unique<testing::FolderPacs>(root_ / "pacs");
    ExportWorkOptions work;
    work.warn = [this](const std::string& line) { warnings_.push_back(line); };
    work_ = std::make_unique<ExportWork>(queue_.get(), server_.get(), pacs_.get(), &writer_, work);
    SeriesIntakeOptions options;
    options.rules = {SmallRule()};
    options.quiet = std::chrono::seconds(30);
    options.count_images = [this](const std::string&, const std::string&) {
      return count_ < 0 ? absl::StatusOr<int64_t>(absl::UnavailableError("no PACS"))
                        : absl::StatusOr<int64_t>(count_);
    };
    options.now = [this] { return now_; };
    intake_ = std::make_unique<SeriesIntake>(queue_.get(), options);
  }

  // Shows a series to the intake, but for some slices.
  testing::CtSeries Receive(const std::string& name, const testing::CtSeriesOptions& options = {},
                            const std::vector<size_t>& without = {}) {
    const fs::path folder = fs::path(queue_->received_folder()) / name;
    fs::create_directories(folder);
    testing::CtSeries series = testing::WriteCtSeries(folder, options);
    for (size_t i = 0; i < series.files.size(); ++i) {
      if (std::count(without.begin(), without.end(), i) > 0) {
        fs::rename(series.files[i], (root_ / (name + std::to_string(i))));
      } else {
        intake_->Arrived(series.files[i], *ReadInstanceHeader(series.files[i]));
      }
    }
    return series;
  }
  SeriesState StateOf(const testing::CtSeries& series) {
    return rows_.GetByUid(series.series_uid)->state;
  }
  void Settle() { ASSERT_THAT(intake_->Settle(), IsOk()); }
  void WaitQuietly() { now_ += std::chrono::seconds(31); }

  // A case of a chosen series, as if it was built and packed.
  QueuedSeries MakeCase(const testing::CtSeries& received) {
    QueuedSeries series = *rows_.GetByUid(received.series_uid);
    CaseFile contents = SampleCase();
    contents.title = series.key;
    const std::string bytes = *SerializeCase(contents);
    fs::create_directories(queue_->plan_folder(series.key));
    std::ofstream(CasePathOf(*queue_, series.key)) << bytes;
    series.case_name = "cases/" + Sha256Hex({bytes});
    series.state = SeriesState::kPublished;
    series.done_s = 1'000'000;
    EXPECT_THAT(rows_.Update(series), IsOk());
    pacs_->headers[received.series_uid] = received.files.front();
    return series;
  }
  testing::CtSeries ReceiveWithCase(const std::string& name,
                                    const testing::CtSeriesOptions& options = {}) {
    testing::CtSeries series = Receive(name, options);
    WaitQuietly();
    Settle();
    EXPECT_EQ(StateOf(series), SeriesState::kChosen);
    MakeCase(series);
    return series;
  }
  void Ask(const std::string& name, const testing::CtSeries& series) {
    v1::Export told;
    told.set_name(name);
    told.set_prediction("predictions/1");
    told.set_case_(rows_.GetByUid(series.series_uid)->case_name);
    told.set_state(v1::EXPORT_STATE_WAITING);
    ASSERT_THAT(work_->Take(told), IsOk());
  }
  void Confirm(const std::string& name) {
    const QueuedSeries series = *rows_.GetByCase(exports_.Get(name)->case_name);
    ASSERT_THAT(exports_.Confirm(name, DigestOf(rows_.GetStudy(series.study_uid)->patient)),
                IsOk());
  }
  // All steps that go at once; the last status.
  absl::Status Work(const std::string& name) {
    QueuedExport queued = *exports_.Get(name);
    absl::Status status;
    for (int i = 0; i < 10 && status.ok() && queued.state != BridgeExportState::kAsked; ++i) {
      status = work_->Step(&queued);
    }
    return status;
  }
  BridgeExportState StateOfExport(const std::string& name) { return exports_.Get(name)->state; }
  std::vector<std::string> Stored() { return testing::LinesOfFile(root_ / "pacs/stores"); }
  std::vector<std::string> Updates() { return testing::LinesOfFile(root_ / "server/updates"); }

  const fs::path root_;
  const std::unique_ptr<BridgeQueue> queue_;
  ReceivedRows rows_;
  ExportRows exports_;
  std::unique_ptr<testing::FolderCaseServer> server_;
  std::unique_ptr<testing::FolderPacs> pacs_;
  testing::HeaderWriter writer_;
  std::vector<std::string> warnings_;
  std::unique_ptr<ExportWork> work_;
  std::chrono::steady_clock::time_point now_ = std::chrono::steady_clock::now();
  int64_t count_ = -1;  // what the PACS counts; -1: it cannot be asked
  std::unique_ptr<SeriesIntake> intake_;
};

TEST_F(BridgeWorkTest, ASeriesIsCompleteWhenNothingComesAnyMore) {
  const testing::CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(BridgeWorkTest, ASeriesIsCompleteAtOnceWhereThePacsCountsAsMany) {
  count_ = 8;
  const testing::CtSeries series = Receive("a");
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kReceiving) << "its association is open";
  intake_->Ended({series.series_uid}, true);
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kChosen);
}

TEST_F(BridgeWorkTest, ASeriesThatStopsMidwayIsNotBuiltUntilTheRestCompletesIt) {
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

TEST_F(BridgeWorkTest, AMissingSliceIsSeenWhereNobodyCounts) {
  const testing::CtSeries series = Receive("a", {}, {4});
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(BridgeWorkTest, AnAbortedAssociationLeavesNothingHalf) {
  const testing::CtSeries series = Receive("a", {}, {6, 7});
  intake_->Ended({series.series_uid}, false);
  WaitQuietly();
  Settle();
  EXPECT_EQ(StateOf(series), SeriesState::kIncomplete);
}

TEST_F(BridgeWorkTest, TheChoiceWaitsForAllSeriesOfTheStudy) {
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

TEST_F(BridgeWorkTest, AChoiceIsToldOnce) {
  const testing::CtSeries series = Receive("a");
  WaitQuietly();
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> changed, intake_->Settle());
  ASSERT_EQ(StateOf(series), SeriesState::kChosen);
  EXPECT_EQ(changed.size(), 1);
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> again, intake_->Settle());
  EXPECT_TRUE(again.empty());
}

TEST_F(BridgeWorkTest, TwoPatientsOfOneSeriesAreNobodys) {
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

TEST_F(BridgeWorkTest, AfterARestartWhatLiesThereIsTaken) {
  const fs::path folder = fs::path(queue_->received_folder()) / "a";
  fs::create_directories(folder);
  const testing::CtSeries series = testing::WriteCtSeries(folder);
  std::ofstream(folder / "x.partial") << "no image";
  ASSERT_THAT(intake_->Recover(), IsOk());
  Settle();
  EXPECT_EQ(rows_.GetByUid(series.series_uid)->images, 8);
}

TEST_F(BridgeWorkTest, AnExportGoesToThePacsAfterAPersonsWord) {
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

TEST_F(BridgeWorkTest, ABandThatCannotBeToldIsSaidAndTheReportGoesWithoutIt) {
  const testing::CtSeries series = ReceiveWithCase("a");
  server_->band = absl::InvalidArgumentError("ranges: 3 tets of 16");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kTold);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(
                             HasSubstr("without its band of uncertainty: ranges: 3 tets of 16")));
}

TEST_F(BridgeWorkTest, ABandThatIsNotKnownIsNoReasonToWarn) {
  const testing::CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_TRUE(warnings_.empty());
}

TEST_F(BridgeWorkTest, AServerWithoutRoomForABandIsAskedSomeTimesAndNotForever) {
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

TEST_F(BridgeWorkTest, APredictionOfAnotherMeshIsRefused) {
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

TEST_F(BridgeWorkTest, WhatIsDrawnOfAnExportThatHasFailedMeanwhileIsRemoved) {
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

TEST_F(BridgeWorkTest, ACaseOfAnotherBridgeIsLeftToIt) {
  v1::Export told;
  told.set_name("exports/1");
  told.set_case_("cases/unknown");
  told.set_state(v1::EXPORT_STATE_WAITING);
  EXPECT_THAT(work_->Take(told), IsOk());
  EXPECT_TRUE(exports_.List()->empty());
}

TEST_F(BridgeWorkTest, APacsThatIsDownIsWaitedFor) {
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

TEST_F(BridgeWorkTest, APacsThatDoesNotLetUsInMayDoSoLater) {
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

TEST_F(BridgeWorkTest, AStudyThatWasDeletedIsToldAndNothingIsStored) {
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

TEST_F(BridgeWorkTest, AMergedPatientGoesBackToThePerson) {
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
  EXPECT_THAT(exports_.Get("exports/1")->note, HasSubstr("another patient ID"));
  EXPECT_THAT(exports_.Get("exports/1")->note, Not(HasSubstr("MERGED-1")));
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "MERGED-1");
  EXPECT_TRUE(Stored().empty());
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(BridgeWorkTest, TwoStudiesAndTwoPatientsKeepTheirOwn) {
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

TEST_F(BridgeWorkTest, ImagesAreDeletedWhenTheirTimeIsOverAndTheCaseStays) {
  const testing::CtSeries series = ReceiveWithCase("a");
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

// Seconds of the clock that files have.
int64_t DaysFromNow(int64_t days) { return std::time(nullptr) + days * 24 * 3600; }

TEST_F(BridgeWorkTest, WhomNoCaseWasMadeOfIsForgottenWithTheHeaders) {
  const testing::CtSeries series = Receive("a", {}, {4});
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

TEST_F(BridgeWorkTest, WhoseCaseWasMadeStaysKnown) {
  const testing::CtSeries series = ReceiveWithCase("a");
  EXPECT_THAT(DeleteOld(queue_.get(), {}, DaysFromNow(1000)), IsOk());
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "PLANTED-4711");
}

TEST_F(BridgeWorkTest, AFileOfNoSeriesIsDeletedInItsTime) {
  testing::CtSeriesOptions one;
  one.study_uid = "1.2.840.1";
  one.series_uid = "1.2.840.2";
  testing::CtSeriesOptions other = one;
  other.study_uid = "1.2.840.3";
  Receive("a", one);
  Settle();
  const testing::CtSeries stranger = Receive("b", other);
  Settle();
  EXPECT_EQ(*DeleteOld(queue_.get(), {}, DaysFromNow(6)), 0);
  EXPECT_TRUE(fs::exists(stranger.files.front()));
  EXPECT_EQ(*DeleteOld(queue_.get(), {}, DaysFromNow(8)), 8);
  EXPECT_FALSE(fs::exists(stranger.files.front()));
}

TEST_F(BridgeWorkTest, WhatComesAnewOfAnOldSeriesIsNotDeletedWhileItComes) {
  const testing::CtSeries series = Receive("a", {}, {4});
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

TEST_F(BridgeWorkTest, NothingOutsideQueueImagesAndHeadersNamesThePatient) {
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
