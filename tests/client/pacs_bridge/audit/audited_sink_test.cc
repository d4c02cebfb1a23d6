// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audited_sink.h"

#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/audit/schema_check.h"
#include "tests/testing/audit_recorder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AuditRecord;
using testing::AuditRecorder;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::SchemaErrors;
using testing::StatusIs;
using testing::ValuesOf;

class CountingSink final : public InstanceSink {
 public:
  absl::Status Keep(const ReceivedInstance& /*instance*/) override {
    ++kept;
    return answer;
  }
  void AssociationEnded(const EndedAssociation& /*ended*/) override { ++ended_count; }
  void ConnectionRefused(const RefusedConnection& /*refused*/) override { ++refused_count; }

  absl::Status answer;
  int kept = 0;
  int ended_count = 0;
  int refused_count = 0;
};

class AuditedSinkTest : public ::testing::Test {
 protected:
  AuditedSinkTest() {
    auto audit = BridgeAudit::Start(std::make_unique<AuditRecorder>(&record_), "TISSUEFORM");
    EXPECT_THAT(audit, IsOk());
    audit_ = *std::move(audit);
    access_.emplace(audit_.get(), AccessAudit::Options{});
    sink_.emplace(audit_.get(), &*access_, &counting_);
  }

  absl::Status Keep(int64_t association, const std::string& study, const std::string& patient) {
    ReceivedInstance instance = {
        .calling_ae = "SCANNER", .address = "192.0.2.7", .association = association};
    instance.header.study_uid = study;
    instance.header.patient_id = patient;
    instance.header.class_uid = "1.2.840.10008.5.1.4.1.1.2";
    return sink_->Keep(instance);
  }
  void End(int64_t association) {
    sink_->AssociationEnded(
        {.association = association, .calling_ae = "SCANNER", .address = "192.0.2.7"});
  }

  // "event outcome objects" of each message.
  std::vector<std::string> Events() {
    EXPECT_TRUE(audit_->Flush());
    std::vector<std::string> events;
    for (const std::string& message : record_.messages()) {
      EXPECT_EQ(SchemaErrors(message), "") << message;
      events.push_back(ValuesOf(message, "//EventID/@csd-code") + " " +
                       ValuesOf(message, "//@EventOutcomeIndicator") + " " +
                       ValuesOf(message, "//@ParticipantObjectID") + " " +
                       ValuesOf(message, "//@NumberOfInstances"));
    }
    return events;
  }

  AuditRecord record_;
  CountingSink counting_;
  std::unique_ptr<BridgeAudit> audit_;
  std::optional<AccessAudit> access_;
  std::optional<AuditedSink> sink_;
};

TEST_F(AuditedSinkTest, AStudyHasOneBeginAndOneEnd) {
  for (int i = 0; i < 3; ++i) EXPECT_THAT(Keep(7, "1.2", "4711"), IsOk());
  End(7);
  EXPECT_THAT(Events(),
              ::testing::ElementsAre("110100 0  ", "110102 0 1.2,4711 ", "110104 0 1.2,4711 3"));
  EXPECT_EQ(counting_.kept, 3);
  EXPECT_EQ(counting_.ended_count, 1);
}

TEST_F(AuditedSinkTest, StudiesPatientsAndAssociationsAreApart) {
  EXPECT_THAT(Keep(1, "1.2", "A"), IsOk());
  EXPECT_THAT(Keep(1, "1.3", "B"), IsOk());
  EXPECT_THAT(Keep(2, "1.2", "A"), IsOk());
  End(1);
  End(2);
  EXPECT_THAT(Events(), ::testing::UnorderedElementsAre(
                            "110100 0  ", "110102 0 1.2,A ", "110102 0 1.3,B ", "110102 0 1.2,A ",
                            "110104 0 1.2,A 1", "110104 0 1.3,B 1", "110104 0 1.2,A 1"));
}

TEST_F(AuditedSinkTest, RefusalIsASeparateEvent) {
  EXPECT_THAT(Keep(1, "1.2", "A"), IsOk());
  counting_.answer = absl::AlreadyExistsError("other bytes");
  EXPECT_THAT(Keep(1, "1.2", "A"), StatusIs(absl::StatusCode::kAlreadyExists));
  End(1);
  EXPECT_THAT(Events(), ::testing::ElementsAre("110100 0  ", "110102 0 1.2,A ", "110104 0 1.2,A 1",
                                               "110104 8 1.2,A 1"));
}

TEST_F(AuditedSinkTest, ReceivesNothingWhileTheAuditLogIsBlocked) {
  ASSERT_TRUE(audit_->Flush());
  record_.Limit(0);
  EXPECT_THAT(Keep(1, "1.2", "A"), IsOk()) << "the last one that nobody could know of";
  EXPECT_FALSE(audit_->Flush());
  EXPECT_THAT(Keep(2, "1.2", "A"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("the audit log")));
  EXPECT_EQ(counting_.kept, 1);
  EXPECT_THAT(Keep(1, "1.2", "A"), IsOk()) << "what has begun has its places";
  End(1);
  End(2);
  record_.Lift();
  while (audit_->Reserve(1) != absl::OkStatus()) std::this_thread::yield();
  EXPECT_THAT(Events(),
              ::testing::ElementsAre("110100 0  ", "110102 0 1.2,A ", "110104 0 1.2,A 2"));
}

TEST_F(AuditedSinkTest, ProcessEndIsRecorded) {
  sink_.reset();
  audit_.reset();
  ASSERT_EQ(record_.messages().size(), 2);
  EXPECT_EQ(ValuesOf(record_.messages()[1], "//EventTypeCode/@csd-code"), "110121");
  EXPECT_EQ(SchemaErrors(record_.messages()[1]), "");
}

TEST_F(AuditedSinkTest, ARefusedConnectionIsAnAlertAndPassedOn) {
  sink_->ConnectionRefused(
      {.address = "192.0.2.9", .calling_ae = "X", .reason = "unknown address"});
  EXPECT_THAT(Events(), ::testing::ElementsAre("110100 0  ", "110113 8  "));
  EXPECT_EQ(counting_.refused_count, 1);
}

}  // namespace
}  // namespace tissueform
