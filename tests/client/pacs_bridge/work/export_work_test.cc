// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_work.h"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/resource.h>

#include "core/base/error_reason.h"
#include "tests/client/pacs_bridge/work/bridge_work.h"
#include "tests/testing/file_bytes.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class ExportWorkTest : public BridgeWork {
 protected:
  // The PACS gives the series another patient ID.
  void Merge(const CtSeries& series) {
    CtSeriesOptions merged;
    merged.study_uid = series.study_uid;
    merged.series_uid = series.series_uid;
    merged.patient_id = "MERGED-1";
    fs::create_directories(root_ / "merged");
    pacs_->headers[series.series_uid] = WriteCtSeries(root_ / "merged", merged).files.front();
  }
};

TEST_F(ExportWorkTest, StoresAnExportOnlyAfterConfirmation) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_TRUE(Stored().empty());
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kReported);
  EXPECT_EQ(Stored().size(), 4);
  EXPECT_THAT(Updates(), Contains("exports/1 EXPORT_STATE_STORED 4 "));
  EXPECT_FALSE(fs::exists(queue_->object_folder(exports_.Get("exports/1")->key)));
}

TEST_F(ExportWorkTest, MissingBandIsReportedAndTheReportOmitsIt) {
  const CtSeries series = ReceiveWithCase("a");
  server_->band = absl::InvalidArgumentError("ranges: 3 tets of 16");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kReported);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(
                             HasSubstr("without a band of uncertainty: ranges: 3 tets of 16")));
}

TEST_F(ExportWorkTest, UnknownBandCausesNoWarning) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_TRUE(warnings_.empty());
}

TEST_F(ExportWorkTest, StopsAskingAFullServerForABand) {
  const CtSeries series = ReceiveWithCase("a");
  server_->band = absl::ResourceExhaustedError("no memory");
  Ask("exports/1", series);
  Confirm("exports/1");
  for (int i = 0; i < 5; ++i) {
    EXPECT_THAT(Work("exports/1"), StatusIs(absl::StatusCode::kResourceExhausted));
  }
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kReported);
  EXPECT_THAT(warnings_, ::testing::ElementsAre(HasSubstr("no memory")));
}

TEST_F(ExportWorkTest, APredictionOfAnotherMeshIsRefused) {
  const CtSeries series = ReceiveWithCase("a");
  server_->mesh = "meshes/another";
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("a different mesh")));
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_TRUE(Stored().empty());
  EXPECT_THAT(Updates(), Contains(HasSubstr("FAILED 0 the prediction has a different mesh")));
}

TEST_F(ExportWorkTest, PicturesOfAFailedExportAreRemoved) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  const QueuedExport asked = *exports_.Get("exports/1");
  Confirm("exports/1");
  pacs_->headers.clear();
  EXPECT_FALSE(Work("exports/1").ok());
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_THAT(work_->Draw(asked), IsOk());
  EXPECT_FALSE(fs::exists(queue_->object_folder(asked.key)));
}

TEST_F(ExportWorkTest, WithdrawnExportLeavesTheQueueWithItsPictures) {
  const CtSeries series = ReceiveWithCase("a");
  for (const char* name : {"exports/1", "exports/2", "exports/3"}) {
    Ask(name, series);
    ASSERT_THAT(work_->Draw(*exports_.Get(name)), IsOk());
  }
  const auto still_asked = [this](const std::string& name) {
    return work_->IsStillAsked(*exports_.Get(name));
  };
  server_->taken_back = {"exports/1"};
  ASSERT_THAT(server_->UpdateExport("exports/2", v1::EXPORT_STATE_FAILED, "", 0), IsOk());
  for (const char* gone : {"exports/1", "exports/2"}) {
    const QueuedExport before = *exports_.Get(gone);
    EXPECT_FALSE(*still_asked(gone));
    EXPECT_THAT(exports_.Get(gone), StatusIs(absl::StatusCode::kNotFound));
    EXPECT_FALSE(fs::exists(queue_->object_folder(before.key)));
    work_->Draw(before).IgnoreError();
    EXPECT_FALSE(fs::exists(queue_->object_folder(before.key))) << "another thread had just begun";
  }
  EXPECT_TRUE(*still_asked("exports/3"));
  server_->away = absl::UnavailableError("the server does not answer");
  EXPECT_EQ(still_asked("exports/3").status(), server_->away);
  EXPECT_EQ(StateOfExport("exports/3"), BridgeExportState::kAsked);
}

TEST_F(ExportWorkTest, SkipsAndReportsACaseOfAnotherBridge) {
  std::vector<std::string> said;
  ExportWorkOptions options;
  options.inform = [&said](const std::string& line) { said.push_back(line); };
  ExportWork work(queue_.get(), server_.get(), pacs_.get(), &writer_, options);
  v1::Export requested;
  requested.set_name("exports/1");
  requested.set_case_("cases/unknown");
  requested.set_state(v1::EXPORT_STATE_WAITING);
  EXPECT_THAT(work.Take(requested), IsOk());
  EXPECT_TRUE(exports_.List()->empty());
  EXPECT_THAT(said, ::testing::ElementsAre(HasSubstr("exports/1 has a case of another bridge")));
}

TEST_F(ExportWorkTest, WaitsForAPacsThatIsDown) {
  const CtSeries series = ReceiveWithCase("a");
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

TEST_F(ExportWorkTest, RetriesAfterThePacsDeniesAccess) {
  const CtSeries series = ReceiveWithCase("a");
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

TEST_F(ExportWorkTest, DeletedStudyIsReportedAndNothingIsStored) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  pacs_->headers.clear();
  EXPECT_THAT(Work("exports/1"), StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_TRUE(Stored().empty());
  EXPECT_THAT(Updates(),
              Contains(HasSubstr("FAILED 0 the PACS no longer has the series of this case")));
}

TEST_F(ExportWorkTest, AMergedPatientGoesBackToThePerson) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  Merge(series);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_FALSE(
      fs::exists(fs::path(queue_->object_folder(exports_.Get("exports/1")->key)) / "header.dcm"));
  EXPECT_THAT(exports_.Get("exports/1")->note, HasSubstr("another patient ID"));
  EXPECT_THAT(exports_.Get("exports/1")->note, Not(HasSubstr("MERGED-1")));
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "MERGED-1");
  EXPECT_THAT(Updates(), ::testing::ElementsAre(HasSubstr("CONFIRMATION 0 waits for confirmation"),
                                                HasSubstr("CONFIRMATION 0 the patient's data")));
  EXPECT_TRUE(Stored().empty());
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(ExportWorkTest, PatientMergedDuringStoringNeedsConfirmationAgain) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  // As a bridge leaves it that ended between the word to the server and its own row.
  ASSERT_THAT(server_->UpdateExport("exports/1", v1::EXPORT_STATE_STORING, "is being written", 0),
              IsOk());
  Merge(series);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_THAT(Updates().back(), HasSubstr("CONFIRMATION 0 the patient's data"));
}

TEST_F(ExportWorkTest, ChangedPatientIsWrittenOnlyOnceTheServerKnows) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  Merge(series);
  server_->away = absl::UnavailableError("the server does not answer");
  EXPECT_EQ(Work("exports/1"), server_->away);
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kConfirmed);
  EXPECT_EQ(rows_.GetStudy(series.study_uid)->patient.id, "PLANTED-4711");
  server_->away = absl::OkStatus();
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_THAT(exports_.Get("exports/1")->note, HasSubstr("another patient ID"));
}

// A PACS with C-FIND and C-MOVE.
class NoHeaderTest : public ExportWorkTest {
 protected:
  NoHeaderTest() {
    series_ = ReceiveWithCase("a");
    Ask("exports/1", series_);
    Confirm("exports/1");
    pacs_->header_service = absl::UnimplementedError("the PACS does not offer C-GET");
  }

  CtSeries series_;
};

TEST_F(NoHeaderTest, UsesTheKeptHeaderForTheSamePatientAndWarns) {
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kReported);
  EXPECT_EQ(Stored().size(), 4);
  EXPECT_THAT(exports_.Get("exports/1")->note, HasSubstr("the header that was received on 2"));
  EXPECT_THAT(warnings_, ::testing::ElementsAre(HasSubstr("exports/1: stored with the header")));
}

TEST_F(NoHeaderTest, MissingOptionalKeysAreNotAnotherPatient) {
  pacs_->returns_optional_keys = false;
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(NoHeaderTest, UsesTheKeptHeaderIfThePacsOffersNoQuery) {
  pacs_->query_service = absl::UnimplementedError("the PACS does not offer C-FIND");
  Merge(series_);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
}

TEST_F(NoHeaderTest, AMergedPatientGoesBackToThePersonAndNothingIsStoredWithTheOldHeader) {
  Merge(series_);
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  EXPECT_THAT(exports_.Get("exports/1")->note,
              ::testing::AllOf(HasSubstr("another patient ID"), HasSubstr("returns no header"),
                               Not(HasSubstr("MERGED-1"))));
  EXPECT_EQ(rows_.GetStudy(series_.study_uid)->patient.id, "MERGED-1");
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("allow C-GET")));
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFailed);
  EXPECT_TRUE(Stored().empty());
}

TEST_F(NoHeaderTest, IgnoresAHeaderThatIsTooOld) {
  ExportWork work(queue_.get(), server_.get(), pacs_.get(), &writer_,
                  {.header_lifetime = std::chrono::seconds(-1)});
  QueuedExport queued = *exports_.Get("exports/1");
  EXPECT_THAT(work.Step(&queued),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("none is kept")));
  EXPECT_EQ(queued.state, BridgeExportState::kFailed);
}

TEST_F(NoHeaderTest, MissingStudyIsReportedAndNothingIsStored) {
  pacs_->headers.clear();
  EXPECT_THAT(Work("exports/1"),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("the PACS no longer has the series of this case")));
  EXPECT_TRUE(Stored().empty());
}

// What a PACS refuses with a status is asked again, and nothing else is taken in its place.
TEST_F(NoHeaderTest, RetriesAfterARefusalByThePacs) {
  const absl::Status refused = absl::FailedPreconditionError("answers with status 0xa700");
  for (absl::Status* service : {&pacs_->header_service, &pacs_->query_service}) {
    const absl::Status before = *service;
    *service = refused;
    EXPECT_THAT(Work("exports/1"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("0xa700")));
    EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kConfirmed);
    *service = before;
  }
  EXPECT_TRUE(Stored().empty());
  pacs_->header_service = absl::OkStatus();
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(Stored().size(), 4);
  EXPECT_TRUE(warnings_.empty());
}

// While it is there, no file becomes larger than that.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit full = {bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &full);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_ = {};
  sighandler_t handler_ = nullptr;
};

TEST_F(ExportWorkTest, WaitsWhileTheDiskIsFull) {
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  writer_.more_bytes = 8 << 20;
  {
    // More than the queue needs, less than an object.
    const FullDisk full(4 << 20);
    const absl::Status status = Work("exports/1");
    EXPECT_TRUE(HasReason(status, ErrorReason::kDiskFull)) << status;
    EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFetched);
  }
  EXPECT_THAT(Work("exports/1"), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kReported);
  EXPECT_EQ(Stored().size(), 4);
}

// Refuses to draw a number of times.
class RefusingWriter final : public HeaderWriter {
 public:
  absl::Status Draw(const ExportMaterial& material, const std::string& folder) override {
    if (refusals-- > 0) return absl::FailedPreconditionError("drawing the pictures failed");
    return HeaderWriter::Draw(material, folder);
  }
  int refusals = 0;
};

TEST_F(ExportWorkTest, RetriesFailedDrawingALimitedNumberOfTimes) {
  RefusingWriter writer;
  ExportWork work(queue_.get(), server_.get(), pacs_.get(), &writer, {});
  const CtSeries series = ReceiveWithCase("a");
  for (const bool for_ever : {false, true}) {
    const std::string name = for_ever ? "exports/2" : "exports/1";
    Ask(name, series);
    Confirm(name);
    QueuedExport queued = *exports_.Get(name);
    EXPECT_THAT(work.Step(&queued), IsOk());
    writer.refusals = for_ever ? 1'000'000 : 3;
    int attempts = 0;
    while (queued.state == BridgeExportState::kFetched && attempts < 1000) {
      work.Step(&queued).IgnoreError();
      ++attempts;
    }
    EXPECT_EQ(queued.state, for_ever ? BridgeExportState::kFailed : BridgeExportState::kWritten);
    EXPECT_EQ(attempts, for_ever ? 21 : 4);
  }
}

TEST_F(ExportWorkTest, TwoStudiesAndTwoPatientsKeepTheirOwn) {
  CtSeriesOptions other;
  other.patient_id = "OTHER";
  other.patient_name = "Other^Otto";
  const CtSeries first = ReceiveWithCase("a");
  const CtSeries again = ReceiveWithCase("b");
  const CtSeries second = ReceiveWithCase("c", other);
  int number = 0;
  for (const CtSeries& series : {first, again, second}) {
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
  const CtSeries series = ReceiveWithCase("a");
  Ask("exports/1", series);
  Confirm("exports/1");
  EXPECT_THAT(Work("exports/1"), IsOk());
  for (const fs::path& place : {root_ / "server", root_ / "state/plans"}) {
    for (const auto& file : fs::recursive_directory_iterator(place)) {
      if (!file.is_regular_file()) continue;
      const std::string bytes = BytesOfFile(file.path());
      for (const char* planted : {"Planted", "PLANTED", "19610203"}) {
        EXPECT_THAT(bytes, Not(HasSubstr(planted))) << file.path();
        EXPECT_THAT(file.path().string(), Not(HasSubstr(planted)));
      }
    }
  }
}

}  // namespace
}  // namespace tissueform::testing
