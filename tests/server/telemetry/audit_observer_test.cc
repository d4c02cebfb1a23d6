// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_observer.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <sys/resource.h>

#include "core/base/error_reason.h"
#include "server/platform/audit_chain/audit_verification.h"
#include "server/telemetry/audit_log.h"
#include "tests/testing/audit_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using testing::IsOk;
using testing::SampleKey;

class AuditObserverTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    Start({});
  }

  void Start(AuditLog::Options options) {
    observer_.reset();
    log_.reset();
    options.file.path = path_;
    options.retry = std::chrono::milliseconds(1);
    auto log = AuditLog::Open(SampleKey(), options);
    ASSERT_THAT(log, IsOk());
    log_ = *std::move(log);
    observer_.emplace(log_.get(), [this] { return now_; });
  }

  ObservedCall Call(std::string_view method, bool served = true) const {
    return {.method = method,
            .kind = CallKind::kNewWork,
            .principal = principal_,
            .resource = "sessions/one",
            .address = "192.0.2.1",
            .request_id = "request-1",
            .traceparent = "",
            .served = served};
  }

  // A call that is let in, where it is, and ends.
  absl::Status Run(std::string_view method, const absl::Status& outcome = absl::OkStatus()) {
    const absl::Status admission = observer_->OnBegin(Call(method, false));
    observer_->OnEnd(Call(method, admission.ok()), admission.ok() ? outcome : admission,
                     std::chrono::milliseconds(3));
    return admission;
  }

  std::vector<nlohmann::json> Lines() {
    EXPECT_TRUE(log_->Flush());
    std::vector<nlohmann::json> lines;
    std::ifstream stream(path_);
    for (std::string text; std::getline(stream, text);)
      lines.push_back(nlohmann::json::parse(text));
    return lines;
  }

  std::vector<std::string> Events() {
    std::vector<std::string> events;
    for (const auto& line : Lines()) events.push_back(line.at("event"));
    return events;
  }

  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      absl::StrCat("audit_observer_",
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const std::string path_ = (folder_ / "audit.jsonl").string();
  Principal principal_ = {.name = "planner@example.org"};
  absl::Time now_ = absl::FromUnixSeconds(1'700'000'000);
  std::unique_ptr<AuditLog> log_;
  std::optional<AuditObserver> observer_;
};

TEST_F(AuditObserverTest, ACallIsOneLineWithWhoWhatFromWhereAndHowItEnded) {
  EXPECT_THAT(Run("SessionService.GetSession", absl::NotFoundError("PLANTED")), IsOk());
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 2);
  nlohmann::json line = lines[1];
  line.erase("mac");
  EXPECT_EQ(line,
            nlohmann::json::parse(R"({"n":2,"event":"call","time":"2023-11-14T22:13:20.000000Z",
      "principal":"planner@example.org","rpc":"SessionService.GetSession","resource":"sessions/one",
      "address":"192.0.2.1","request_id":"request-1","code":"NOT_FOUND","reason":"NOT_FOUND","duration_ms":3})"));
}

TEST_F(AuditObserverTest, AStreamIsToldWhenItOpensNamesItsResourceAndCloses) {
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  EXPECT_THAT(Events(), ElementsAre("begin", "open"));
  observer_->OnResource(Call("DeformService.Deform"));
  EXPECT_THAT(Events(), ElementsAre("begin", "open", "use"));
  observer_->OnEnd(Call("DeformService.Deform"), absl::OkStatus(), {});
  EXPECT_THAT(Events(), ElementsAre("begin", "open", "use", "close"));
}

TEST_F(AuditObserverTest, WhatTouchesNoContentIsLeftOut) {
  EXPECT_THAT(Run("ServerInfoService.GetServerInfo"), IsOk());
  EXPECT_THAT(Run("AccessService.WhoAmI"), IsOk());
  EXPECT_THAT(Run("DeformService.AcknowledgeWatch"), IsOk());
  EXPECT_THAT(Events(), ElementsAre("begin"));
}

TEST_F(AuditObserverTest, AFloodOfRefusedCallsIsCounted) {
  for (int i = 0; i < 1000; ++i) {
    observer_->OnEnd(Call("SessionService.GetSession", false), absl::UnauthenticatedError(""), {});
  }
  now_ += absl::Seconds(1);
  observer_->OnEnd(Call("SessionService.GetSession", false), absl::UnauthenticatedError(""), {});
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 1 + AuditObserver::kRefusedLinesASecond + 2);
  EXPECT_EQ(lines[1].at("event"), "refused");
  EXPECT_EQ(lines[1].at("code"), "UNAUTHENTICATED");
  EXPECT_EQ(lines[lines.size() - 2].at("event"), "refused_more");
  EXPECT_EQ(lines[lines.size() - 2].at("count"), 1000 - AuditObserver::kRefusedLinesASecond);
}

TEST_F(AuditObserverTest, WithoutAPlaceForItsLineACallIsRefused) {
  Start({.file = {}, .most = 4});
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  EXPECT_TRUE(log_->Flush());
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  EXPECT_TRUE(log_->Flush());
  EXPECT_THAT(observer_->OnBegin(Call("SessionService.GetSession", false)), IsOk());
  EXPECT_THAT(observer_->OnBegin(Call("SessionService.GetSession", false)), IsOk());
  const absl::Status refused = observer_->OnBegin(Call("SessionService.GetSession", false));
  EXPECT_TRUE(absl::IsUnavailable(refused)) << refused;
  EXPECT_TRUE(HasReason(refused, ErrorReason::kAuditNotWritten));
  observer_->OnEnd(Call("DeformService.Deform"), absl::OkStatus(), {});
  EXPECT_TRUE(log_->Flush());
  EXPECT_THAT(observer_->OnBegin(Call("SessionService.GetSession", false)), IsOk());
}

// As on a full disk.
TEST_F(AuditObserverTest, WhileItCannotBeWrittenCallsAreRefusedAndAfterwardsNothingIsMissing) {
  std::signal(SIGXFSZ, SIG_IGN);
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  ASSERT_TRUE(log_->Flush());
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit full = {.rlim_cur = fs::file_size(path_) + 40, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk()) << "the last one that nobody could know of";
  EXPECT_FALSE(log_->Flush());
  EXPECT_TRUE(log_->Read().failing);
  const absl::Status refused = Run("SessionService.GetSession");
  const absl::Status looks = Run("ServerInfoService.GetServerInfo");
  observer_->OnEnd(Call("DeformService.Deform"), absl::OkStatus(), {});
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_TRUE(HasReason(refused, ErrorReason::kAuditNotWritten)) << refused;
  EXPECT_THAT(looks, IsOk());
  while (log_->Read().failing) std::this_thread::yield();
  EXPECT_THAT(Events(), ElementsAre("begin", "call", "open", "call", "refused", "close"));
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
}

TEST_F(AuditObserverTest, WhatFindsNoRoomIsCountedInTheChain) {
  Start({.file = {}, .most = 1});
  ASSERT_THAT(log_->Reserve(1), IsOk());
  for (int i = 0; i < 3; ++i) {
    observer_->OnEnd(Call("SessionService.GetSession", false), absl::UnauthenticatedError(""), {});
  }
  EXPECT_EQ(log_->Read().lost, 3);
  log_->Write("\"event\":\"call\"");
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 3);
  EXPECT_EQ(lines[1].at("event"), "lost");
  EXPECT_EQ(lines[1].at("count"), 3);
}

TEST_F(AuditObserverTest, CheckpointsTellWhereTheLogIsAndTheEndOfARun) {
  std::vector<std::string> told;
  Start({.file = {},
         .checkpoint = [&told](const std::string& text) { told.push_back(text); },
         .checkpoint_lines = 3});
  for (int i = 0; i < 4; ++i) {
    EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
    EXPECT_TRUE(log_->Flush());
  }
  observer_.reset();
  log_.reset();
  ASSERT_FALSE(told.empty());
  std::vector<AuditCheckpoint> checkpoints;
  checkpoints.reserve(told.size());
  for (const std::string& text : told) checkpoints.push_back(*ParseCheckpoint(text));
  EXPECT_EQ(checkpoints.back().number, 5);
  const auto report = VerifyAuditFiles({path_}, SampleKey(), checkpoints);
  ASSERT_THAT(report, IsOk());
  EXPECT_FALSE(report->finding.has_value());
}

TEST_F(AuditObserverTest, ManyThreadsWriteOneChain) {
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this] {
      for (int j = 0; j < 200; ++j) EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(Lines().size(), 801);
  const auto report = VerifyAuditFiles({path_}, SampleKey());
  ASSERT_THAT(report, IsOk());
  EXPECT_FALSE(report->finding.has_value());
}

TEST_F(AuditObserverTest, OverlongNamesStayWithinALine) {
  principal_.name = std::string(100'000, '"');
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
  EXPECT_TRUE(log_->Flush());
  const auto report = VerifyAuditFiles({path_}, SampleKey());
  ASSERT_THAT(report, IsOk());
  EXPECT_FALSE(report->finding.has_value());
}

}  // namespace
}  // namespace tissueform
