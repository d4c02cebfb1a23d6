// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audited_pacs_client.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dctk.h>

#include "core/base/error_reason.h"
#include "tests/client/pacs_bridge/audit/schema_check.h"
#include "tests/testing/audit_recorder.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using testing::AuditRecord;
using testing::AuditRecorder;
using ::testing::ElementsAre;
using testing::IsOk;
using testing::SchemaErrors;
using testing::StatusIs;
using testing::ValuesOf;

// Answers every call by `answer`, and counts them.
class FakePacs final : public PacsClient {
 public:
  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery& /*query*/) override {
    if (!Call().ok()) return answer;
    return std::vector<SeriesSummary>{};
  }
  absl::StatusOr<PatientSummary> FindPatient(const std::string& /*study_uid*/) override {
    if (!Call().ok()) return answer;
    return PatientSummary{.name = "Planted^Patricia"};
  }
  absl::StatusOr<FetchCounts> FetchSeries(const std::string& /*study_uid*/,
                                          const std::string& /*series_uid*/,
                                          InstanceFolder* /*folder*/,
                                          InstanceSink* /*sink*/) override {
    if (!Call().ok()) return answer;
    return FetchCounts{};
  }
  absl::Status FetchHeader(const std::string& /*study_uid*/, const std::string& /*series_uid*/,
                           const std::string& path) override {
    if (Call().ok()) fs::copy_file(header, path);
    return answer;
  }
  absl::StatusOr<bool> Has(const std::string& /*study_uid*/, const std::string& /*series_uid*/,
                           const std::string& /*instance_uid*/) override {
    if (!Call().ok()) return answer;
    return true;
  }
  absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) override {
    if (!Call().ok()) return answer;
    std::vector<StoredObject> stored;
    for (const std::string& path : paths) {
      const bool refuses = static_cast<int>(stored.size()) >= takes;
      stored.push_back(
          {.path = path,
           .status = refuses ? absl::FailedPreconditionError("status 0xa700") : absl::OkStatus()});
    }
    return stored;
  }
  const absl::Status& Call() {
    ++calls;
    return answer;
  }

  absl::Status answer;
  std::string header;
  int takes = 1000;
  int calls = 0;
};

class AuditedPacsClientTest : public ::testing::Test {
 protected:
  AuditedPacsClientTest() {
    auto audit = BridgeAudit::Start(std::make_unique<AuditRecorder>(&record_), "TISSUEFORM");
    EXPECT_THAT(audit, IsOk());
    audit_ = *std::move(audit);
    auto fake = std::make_unique<FakePacs>();
    fake_ = fake.get();
    pacs_ = MakeAuditedPacsClient(audit_.get(),
                                  {.host = "pacs.example.org", .port = 104, .ae_title = "PACS"},
                                  std::move(fake));
    series_ = testing::WriteCtSeries(folder_, {.slices = 3});
    fake_->header = series_.files[0];
  }

  // Since the start of the application.
  std::vector<std::string> Messages() {
    EXPECT_TRUE(audit_->Flush());
    std::vector<std::string> messages = record_.messages();
    for (const std::string& message : messages) {
      EXPECT_EQ(SchemaErrors(message), "") << message;
      EXPECT_EQ(message.find("Patricia"), std::string::npos) << "no names";
    }
    messages.erase(messages.begin());
    return messages;
  }
  std::vector<std::string> Events() {
    std::vector<std::string> events;
    for (const std::string& message : Messages()) {
      events.push_back(ValuesOf(message, "//EventID/@csd-code") + " " +
                       ValuesOf(message, "//@EventOutcomeIndicator") + " " +
                       ValuesOf(message, "//@NumberOfInstances"));
    }
    return events;
  }

  const fs::path folder_ =
      testing::EmptyTestFolder(std::string("audited_pacs_") +
                               ::testing::UnitTest::GetInstance()->current_test_info()->name());
  AuditRecord record_;
  std::unique_ptr<BridgeAudit> audit_;
  FakePacs* fake_ = nullptr;
  std::unique_ptr<PacsClient> pacs_;
  testing::CtSeries series_;
};

TEST_F(AuditedPacsClientTest, AQueryHoldsItsIdentifier) {
  EXPECT_THAT(pacs_->FindSeries({.study_uid = "1.2.3"}), IsOk());
  const std::vector<std::string> messages = Messages();
  ASSERT_EQ(messages.size(), 1);
  EXPECT_EQ(ValuesOf(messages[0], "//EventID/@csd-code"), "110112");
  EXPECT_EQ(ValuesOf(messages[0], "//ActiveParticipant[RoleIDCode/@csd-code='110152']/@UserID"),
            "PACS");
  EXPECT_EQ(ValuesOf(messages[0], "//@NetworkAccessPointID"), "pacs.example.org");
  std::string bytes;
  ASSERT_TRUE(absl::Base64Unescape(ValuesOf(messages[0], "//ParticipantObjectQuery"), &bytes));
  DcmInputBufferStream stream;
  stream.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  stream.setEos();
  DcmDataset identifier;
  ASSERT_TRUE(identifier.read(stream, EXS_LittleEndianExplicit).good());
  OFString value;
  EXPECT_TRUE(identifier.findAndGetOFString(DCM_StudyInstanceUID, value).good());
  EXPECT_EQ(value, "1.2.3");
  EXPECT_TRUE(identifier.findAndGetOFString(DCM_QueryRetrieveLevel, value).good());
  EXPECT_EQ(value, "SERIES");
}

TEST_F(AuditedPacsClientTest, EveryQueryIsAudited) {
  EXPECT_THAT(pacs_->FindPatient("1.2"), IsOk());
  EXPECT_THAT(pacs_->Has("1.2", "1.3", "1.4"), IsOk());
  fake_->answer = absl::UnavailableError("the PACS 'PACS' does not answer");
  EXPECT_THAT(pacs_->FindPatient("1.2"), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(Events(), ElementsAre("110112 0 ", "110112 0 ", "110112 8 "));
}

TEST_F(AuditedPacsClientTest, AHeaderIsATransferWithItsPatient) {
  EXPECT_THAT(pacs_->FetchHeader(series_.study_uid, series_.series_uid, folder_ / "header.dcm"),
              IsOk());
  const std::vector<std::string> messages = Messages();
  ASSERT_EQ(messages.size(), 1);
  EXPECT_EQ(ValuesOf(messages[0], "//@ParticipantObjectID"), series_.study_uid + ",PLANTED-4711");
  EXPECT_EQ(ValuesOf(messages[0], "//ActiveParticipant[RoleIDCode/@csd-code='110153']/@UserID"),
            "PACS");
}

TEST_F(AuditedPacsClientTest, AFetchThatFailsIsAudited) {
  EXPECT_THAT(pacs_->FetchSeries("1.2", "1.3", nullptr, nullptr), IsOk());
  fake_->answer = absl::UnavailableError("gone");
  EXPECT_THAT(pacs_->FetchSeries("1.2", "1.3", nullptr, nullptr),
              StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(Events(), ElementsAre("110104 8 ")) << "the sink tells what has come";
}

TEST_F(AuditedPacsClientTest, StoreRecordsBeginAndEnd) {
  EXPECT_THAT(pacs_->Store(series_.files), IsOk());
  fake_->takes = 2;
  EXPECT_THAT(pacs_->Store(series_.files), IsOk());
  fake_->answer = absl::UnavailableError("gone");
  EXPECT_THAT(pacs_->Store(series_.files), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(Events(), ElementsAre("110102 0 3", "110104 0 3",                //
                                    "110102 0 3", "110104 0 2", "110104 8 1",  //
                                    "110102 0 3", "110104 8 3"));
}

TEST_F(AuditedPacsClientTest, ARefusalIsASecurityAlert) {
  fake_->answer = absl::PermissionDeniedError("the PACS 'PACS' does not know our AE title");
  EXPECT_THAT(pacs_->FindPatient("1.2"), StatusIs(absl::StatusCode::kPermissionDenied));
  fake_->answer = absl::UnauthenticatedError("certificate");
  EXPECT_THAT(pacs_->FetchSeries("1.2", "1.3", nullptr, nullptr),
              StatusIs(absl::StatusCode::kUnauthenticated));
  EXPECT_THAT(Events(), ElementsAre("110112 8 ", "110113 8 ", "110104 8 ", "110113 8 "));
}

TEST_F(AuditedPacsClientTest, DoesNotCallThePacsWhileTheAuditLogIsBlocked) {
  ASSERT_TRUE(audit_->Flush());
  record_.Limit(0);
  EXPECT_THAT(pacs_->FindPatient("1.2"), IsOk()) << "the last one that nobody could know of";
  EXPECT_FALSE(audit_->Flush());
  const auto refused = {pacs_->FindSeries({}).status(),
                        pacs_->FindPatient("1.2").status(),
                        pacs_->Has("1", "2", "3").status(),
                        pacs_->FetchSeries("1.2", "1.3", nullptr, nullptr).status(),
                        pacs_->FetchHeader("1.2", "1.3", folder_ / "header.dcm"),
                        pacs_->Store(series_.files).status()};
  for (const absl::Status& status : refused) {
    EXPECT_TRUE(HasReason(status, ErrorReason::kAuditNotWritten)) << status;
  }
  EXPECT_EQ(fake_->calls, 1);
}

}  // namespace
}  // namespace tissueform
