// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/access_audit.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/pacs_bridge/audit/schema_check.h"
#include "tests/testing/audit_recorder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AuditRecord;
using testing::AuditRecorder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::SchemaErrors;
using ::testing::SizeIs;
using testing::ValuesOf;

class AccessAuditTest : public ::testing::Test {
 protected:
  AccessAuditTest() {
    auto audit = BridgeAudit::Start(std::make_unique<AuditRecorder>(&record_), "TISSUEFORM");
    EXPECT_THAT(audit, IsOk());
    audit_ = *std::move(audit);
  }

  void Start(const AccessAudit::Options& options = {}) { access_.emplace(audit_.get(), options); }

  // Messages but that of the start of the program.
  std::vector<std::string> Messages() {
    EXPECT_TRUE(audit_->Flush());
    std::vector<std::string> messages = record_.messages();
    for (const std::string& message : messages) EXPECT_EQ(SchemaErrors(message), "") << message;
    if (!messages.empty()) messages.erase(messages.begin());
    return messages;
  }
  // "event outcome user address reason" of each.
  std::vector<std::string> Events() {
    std::vector<std::string> events;
    for (const std::string& message : Messages()) {
      events.push_back(
          absl::StrCat(ValuesOf(message, "//EventID/@csd-code"), " ",
                       ValuesOf(message, "//@EventOutcomeIndicator"), " ",
                       ValuesOf(message, "//ActiveParticipant[@UserIsRequestor='true']/@UserID"),
                       " ", ValuesOf(message, "//@NetworkAccessPointID"), " ",
                       ValuesOf(message, "//EventOutcomeDescription")));
    }
    return events;
  }

  AuditRecord record_;
  std::unique_ptr<BridgeAudit> audit_;
  std::optional<AccessAudit> access_;
};

TEST_F(AccessAuditTest, RefusalsStateTheSourceAndTheReason) {
  Start();
  access_->ConnectionRefused(
      {.address = "192.0.2.9", .calling_ae = "EVIL", .reason = "unknown calling AE title"});
  access_->ConnectionRefused({.address = "192.0.2.8", .reason = "unknown address"});
  access_->LoginRefused("192.0.2.7", "eve");
  EXPECT_THAT(Events(), ElementsAre("110113 8 EVIL 192.0.2.9 unknown calling AE title",
                                    "110113 8 unknown 192.0.2.8 unknown address",
                                    "110114 8 eve 192.0.2.7 wrong password of the review page"));
}

TEST_F(AccessAuditTest, SummarizesAFloodInAFewEventsAndACount) {
  Start({.limit = {.max_per_source = 3}});
  for (int i = 0; i < 1000; ++i) {
    access_->ConnectionRefused({.address = "192.0.2.9", .reason = "unknown address"});
    access_->LoginRefused("192.0.2.10", "eve");
  }
  access_->ConnectionRefused({.address = "192.0.2.11", .reason = "unknown address"});
  EXPECT_THAT(Messages(), SizeIs(7));
  access_.reset();
  const std::vector<std::string> events = Events();
  ASSERT_THAT(events, SizeIs(8));
  EXPECT_THAT(events.back(), HasSubstr("1994 more refusals"));
}

TEST_F(AccessAuditTest, ReportsTheCountWhenThePeriodEnds) {
  Start({.limit = {.max_per_source = 1, .period = std::chrono::milliseconds(50)}});
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!absl::StrContains(absl::StrJoin(Messages(), ""), "more refusals")) {
    ASSERT_LT(std::chrono::steady_clock::now(), until);
    access_->LoginRefused("192.0.2.9", "eve");
  }
}

TEST_F(AccessAuditTest, AUserLogsInOnceUntilSilent) {
  Start();
  for (int i = 0; i < 5; ++i) EXPECT_THAT(access_->LoginAccepted("192.0.2.7", "ada"), IsOk());
  EXPECT_THAT(access_->LoginAccepted("192.0.2.8", "ada"), IsOk());
  EXPECT_THAT(Events(), ElementsAre("110114 0 ada 192.0.2.7 ", "110114 0 ada 192.0.2.8 "));
}

TEST_F(AccessAuditTest, AfterSilenceItIsANewLogin) {
  Start({.max_silence = std::chrono::seconds(0)});
  for (int i = 0; i < 2; ++i) EXPECT_THAT(access_->LoginAccepted("192.0.2.7", ""), IsOk());
  EXPECT_THAT(Events(), ElementsAre("110114 0 unknown 192.0.2.7 ", "110114 0 unknown 192.0.2.7 "));
}

TEST_F(AccessAuditTest, TheLongestSilentUserIsForgotten) {
  Start({.max_users = 2});
  for (const char* user : {"ada", "bob", "cyd", "ada", "cyd"}) {
    EXPECT_THAT(access_->LoginAccepted("192.0.2.7", user), IsOk());
  }
  EXPECT_THAT(Events(), SizeIs(4)) << "ada twice, bob and cyd once";
}

}  // namespace
}  // namespace tissueform
