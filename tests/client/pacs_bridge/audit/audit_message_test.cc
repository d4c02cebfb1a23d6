// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audit_message.h"

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/audit/schema_check.h"

namespace tissueform {
namespace {

using testing::SchemaErrors;
using testing::ValuesOf;
using Role = AuditParticipant::Role;

AuditEvent TransferEvent() {
  return {.kind = AuditEvent::Kind::kTransferred,
          .time = absl::FromUnixMillis(1'700'000'000'007),
          .source = "TISSUEFORM",
          .participants = {{.role = Role::kSource,
                            .user_id = "SCANNER",
                            .ae_title = "SCANNER",
                            .host = "192.0.2.7",
                            .is_requestor = true},
                           {.role = Role::kDestination, .user_id = "17", .ae_title = "TISSUEFORM"}},
          .study = AuditedStudy{.study_uid = "1.2.3",
                                .patient_id = "4711",
                                .objects_of_class = {{"1.2.840.10008.5.1.4.1.1.2", 120}}}};
}

TEST(AuditMessage, ATransferNamesBothSidesTheStudyAndThePatient) {
  const std::string message = ToAuditMessage(TransferEvent());
  EXPECT_EQ(SchemaErrors(message), "") << message;
  EXPECT_EQ(ValuesOf(message, "//EventID/@csd-code"), "110104");
  EXPECT_EQ(ValuesOf(message, "//@EventDateTime"), "2023-11-14T22:13:20.007Z");
  EXPECT_EQ(ValuesOf(message, "//@EventOutcomeIndicator"), "0");
  EXPECT_EQ(ValuesOf(message, "//ActiveParticipant[RoleIDCode/@csd-code='110153']/@UserID"),
            "SCANNER");
  EXPECT_EQ(ValuesOf(message, "//ActiveParticipant[1]/@NetworkAccessPointTypeCode"), "2");
  EXPECT_EQ(ValuesOf(message, "//ActiveParticipant[2]/@AlternativeUserID"), "AETITLES=TISSUEFORM");
  EXPECT_EQ(ValuesOf(message, "//@AuditSourceID"), "TISSUEFORM");
  EXPECT_EQ(ValuesOf(message, "//@ParticipantObjectID"), "1.2.3,4711");
  EXPECT_EQ(ValuesOf(message, "//SOPClass/@NumberOfInstances"), "120");
}

TEST(AuditMessage, EveryKindFollowsTheSchema) {
  for (const auto kind :
       {AuditEvent::Kind::kApplicationStart, AuditEvent::Kind::kApplicationStop,
        AuditEvent::Kind::kQuery, AuditEvent::Kind::kTransferBegin, AuditEvent::Kind::kTransferred,
        AuditEvent::Kind::kLogin, AuditEvent::Kind::kNodeRefused}) {
    for (const absl::Status& outcome : {absl::OkStatus(), absl::UnavailableError("is <away>")}) {
      AuditEvent event = TransferEvent();
      event.kind = kind;
      event.outcome = outcome;
      event.query = std::string("\x08\x00\0\xff", 4);
      event.participants.push_back(
          {.user_id = "https://pacs.example/dicom-web", .host = "https://pacs.example/dicom-web"});
      const std::string message = ToAuditMessage(event);
      EXPECT_EQ(SchemaErrors(message), "") << message;
      EXPECT_EQ(ValuesOf(message, "//EventOutcomeDescription"), outcome.ok() ? "" : "is <away>");
    }
  }
}

TEST(AuditMessage, OmitsMissingValues) {
  AuditEvent event = TransferEvent();
  event.study = AuditedStudy{.study_uid = "1.2.3"};
  const std::string message = ToAuditMessage(event);
  EXPECT_EQ(SchemaErrors(message), "") << message;
  EXPECT_EQ(ValuesOf(message, "//@ParticipantObjectID"), "1.2.3");
}

TEST(AuditMessage, TextsFromOutsideStayTexts) {
  const std::vector<std::pair<std::string, std::string>> texts = {
      {"\"/><AuditMessage a='&lt;", "\"/><AuditMessage a='&lt;"},
      {"M\xc3\xbcller \xe6\x9d\xb1 \xf0\x9f\xa6\xb7",
       "M\xc3\xbcller \xe6\x9d\xb1 \xf0\x9f\xa6\xb7"},
      {std::string("a\0b\nc\x1b"
                   "d\x7f",
                   8),
       "a?b?c?d\x7f"},
      {"\xff\xc3(\xed\xa0\x80\xf5\x90\x80\x80\xef\xbf\xbf",
       std::string(2, '?') + "(" + std::string(3, '?')},
      {"\xe6\x9d", std::string(2, '?')},
      {std::string(1000, 'x'), std::string(256, 'x')}};
  for (const auto& [text, expected] : texts) {
    AuditEvent event = TransferEvent();
    event.study->patient_id = text;
    event.participants[0].user_id = text;
    const std::string message = ToAuditMessage(event);
    EXPECT_EQ(SchemaErrors(message), "") << message;
    EXPECT_EQ(ValuesOf(message, "//ActiveParticipant[1]/@UserID"), expected);
    for (const char c : message) ASSERT_TRUE(c >= ' ' && c <= '~') << message;
  }
}

// The schema is ours to write down: it must be able to refuse.
TEST(AuditMessage, SchemaRefusesInvalidMessages) {
  const std::string right = ToAuditMessage(TransferEvent());
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"EventActionCode=\"C\"", "EventActionCode=\"X\""},
           {"EventDateTime=\"2023-11-14T22", "EventDateTime=\"yesterday"},
           {"originalText", "displayName"},
           {"<ParticipantObjectName/>", ""},
           {"NumberOfInstances=\"120\"", ""},
           {"AuditSourceID", "AuditSource"}}) {
    std::string wrong = right;
    wrong.replace(wrong.find(from), from.size(), to);
    EXPECT_NE(SchemaErrors(wrong), "") << wrong;
  }
}

}  // namespace
}  // namespace tissueform
