// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_log.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/testing/audit_recorder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AuditRecord;
using testing::AuditRecorder;
using ::testing::ElementsAre;
using testing::IsOk;

class AuditLogTest : public ::testing::Test {
 protected:
  AuditLogTest() { Start({}); }

  void Start(AuditLog::Options options) {
    options.retry = std::chrono::milliseconds(1);
    log_.emplace(std::make_unique<AuditRecorder>(&record_), options);
  }
  void Write(const std::string& message) {
    ASSERT_THAT(log_->Reserve(1), IsOk());
    log_->Write(message);
  }

  AuditRecord record_;
  std::optional<AuditLog> log_;
};

TEST_F(AuditLogTest, BlockedSinkRefusesReservationsAndLosesNothing) {
  Write("one");
  ASSERT_THAT(log_->Reserve(1), IsOk());
  ASSERT_TRUE(log_->Flush());
  record_.Limit(0);
  Write("the last one that nobody could know of");
  EXPECT_FALSE(log_->Flush());
  EXPECT_TRUE(log_->Read().failing);
  const absl::Status refused = log_->Reserve(1);
  EXPECT_TRUE(absl::IsUnavailable(refused)) << refused;
  EXPECT_TRUE(HasReason(refused, ErrorReason::kAuditNotWritten));
  log_->Write("reserved before");
  record_.Lift();
  while (log_->Read().failing) std::this_thread::yield();
  Write("after");
  EXPECT_TRUE(log_->Flush());
  EXPECT_THAT(record_.messages(), ElementsAre("one", "the last one that nobody could know of",
                                              "reserved before", "after"));
}

TEST_F(AuditLogTest, ASinkThatTakesAPartGetsTheRestOnce) {
  record_.Limit(2);
  for (const char* message : {"1", "2", "3", "4"}) log_->WriteIfRoom(message);
  EXPECT_FALSE(log_->Flush());
  record_.Lift();
  while (log_->Read().failing) std::this_thread::yield();
  EXPECT_TRUE(log_->Flush());
  EXPECT_THAT(record_.messages(), ElementsAre("1", "2", "3", "4"));
  EXPECT_EQ(log_->Read().written, 4);
}

TEST_F(AuditLogTest, PlacesAreLimitedAndComeBack) {
  Start({.max_waiting = 2});
  EXPECT_THAT(log_->Reserve(2), IsOk());
  EXPECT_TRUE(HasReason(log_->Reserve(1), ErrorReason::kAuditNotWritten));
  log_->Release(1);
  EXPECT_THAT(log_->Reserve(1), IsOk());
  log_->Write("one");
  ASSERT_TRUE(log_->Flush());
  EXPECT_THAT(log_->Reserve(1), IsOk());
  EXPECT_TRUE(HasReason(log_->Reserve(1), ErrorReason::kAuditNotWritten));
}

TEST_F(AuditLogTest, CountsAndReportsMessagesThatFindNoRoom) {
  Start({.lost_message = [](int64_t count) { return absl::StrCat("lost ", count); },
         .max_waiting = 1});
  ASSERT_THAT(log_->Reserve(1), IsOk());
  for (int i = 0; i < 3; ++i) log_->WriteIfRoom("no room");
  EXPECT_EQ(log_->Read().lost, 3);
  log_->Write("one");
  ASSERT_TRUE(log_->Flush());
  EXPECT_THAT(record_.messages(), ElementsAre("lost 3", "one"));
}

TEST_F(AuditLogTest, TheEndWaitsForTheSink) {
  for (int i = 0; i < 5000; ++i) Write("message");
  log_.reset();
  EXPECT_EQ(record_.messages().size(), 5000);
}

TEST_F(AuditLogTest, TheEndDoesNotWaitForASinkThatTakesNothing) {
  record_.Limit(0);
  Write("one");
  log_.reset();
  EXPECT_TRUE(record_.messages().empty());
}

TEST_F(AuditLogTest, ManyThreadsWriteOneLog) {
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this] {
      for (int j = 0; j < 200; ++j) Write("message");
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(log_->Flush());
  EXPECT_EQ(record_.messages().size(), 800);
}

}  // namespace
}  // namespace tissueform
