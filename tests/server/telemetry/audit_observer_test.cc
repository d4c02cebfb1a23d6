// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_observer.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/base/error_reason.h"
#include "server/platform/audit/audit_log.h"
#include "tests/testing/audit_recorder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AuditRecord;
using testing::AuditRecorder;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::IsOk;

class AuditObserverTest : public ::testing::Test {
 protected:
  AuditObserverTest() { Start({}); }

  void Start(AuditLog::Options options) {
    observer_.reset();
    options.retry = std::chrono::milliseconds(1);
    log_.emplace(std::make_unique<AuditRecorder>(&record_), options);
    observer_.emplace(&*log_, [this] { return now_; });
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
    for (const std::string& text : record_.messages()) lines.push_back(nlohmann::json::parse(text));
    return lines;
  }

  std::vector<std::string> Events() {
    std::vector<std::string> events;
    for (const auto& line : Lines()) events.push_back(line.at("event"));
    return events;
  }

  Principal principal_ = {.name = "planner@example.org"};
  absl::Time now_ = absl::FromUnixSeconds(1'700'000'000);
  AuditRecord record_;
  std::optional<AuditLog> log_;
  std::optional<AuditObserver> observer_;
};

TEST_F(AuditObserverTest, LogsACallInOneLineWithCallerAddressAndOutcome) {
  EXPECT_THAT(Run("SessionService.GetSession", absl::NotFoundError("PLANTED")), IsOk());
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 1);
  EXPECT_EQ(lines[0], nlohmann::json::parse(R"({"event":"call","time":"2023-11-14T22:13:20.000000Z",
      "principal":"planner@example.org","rpc":"SessionService.GetSession","resource":"sessions/one",
      "address":"192.0.2.1","request_id":"request-1","code":"NOT_FOUND","reason":"NOT_FOUND","duration_ms":3})"));
}

TEST_F(AuditObserverTest, AStreamIsLoggedWhenItOpensNamesItsResourceAndCloses) {
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  EXPECT_THAT(Events(), ElementsAre("open"));
  observer_->OnResource(Call("DeformService.Deform"));
  EXPECT_THAT(Events(), ElementsAre("open", "use"));
  observer_->OnEnd(Call("DeformService.Deform"), absl::OkStatus(), {});
  EXPECT_THAT(Events(), ElementsAre("open", "use", "close"));
}

TEST_F(AuditObserverTest, OmitsCallsThatTouchNoContent) {
  EXPECT_THAT(Run("ServerInfoService.GetServerInfo"), IsOk());
  EXPECT_THAT(Run("AccessService.WhoAmI"), IsOk());
  EXPECT_THAT(Run("DeformService.AcknowledgeWatch"), IsOk());
  EXPECT_THAT(Events(), IsEmpty());
}

TEST_F(AuditObserverTest, AFloodOfRefusedCallsIsCounted) {
  for (int i = 0; i < 1000; ++i) {
    observer_->OnEnd(Call("SessionService.GetSession", false), absl::UnauthenticatedError(""), {});
  }
  now_ += absl::Seconds(1);
  observer_->OnEnd(Call("SessionService.GetSession", false), absl::UnauthenticatedError(""), {});
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), AuditObserver::kRefusedLinesASecond + 2);
  EXPECT_EQ(lines[0].at("event"), "refused");
  EXPECT_EQ(lines[0].at("code"), "UNAUTHENTICATED");
  EXPECT_EQ(lines[lines.size() - 2].at("event"), "refused_more");
  EXPECT_EQ(lines[lines.size() - 2].at("count"), 1000 - AuditObserver::kRefusedLinesASecond);
}

TEST_F(AuditObserverTest, WithoutAPlaceForItsLineACallIsRefused) {
  Start({.max_waiting = 4});
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

TEST_F(AuditObserverTest, BlockedSinkRefusesCallsAndLosesNothing) {
  EXPECT_THAT(observer_->OnBegin(Call("DeformService.Deform", false)), IsOk());
  ASSERT_TRUE(log_->Flush());
  record_.Limit(0);
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk()) << "the last one that nobody could know of";
  EXPECT_FALSE(log_->Flush());
  const absl::Status refused = Run("SessionService.GetSession");
  const absl::Status info = Run("ServerInfoService.GetServerInfo");
  observer_->OnEnd(Call("DeformService.Deform"), absl::OkStatus(), {});
  EXPECT_TRUE(HasReason(refused, ErrorReason::kAuditNotWritten)) << refused;
  EXPECT_THAT(info, IsOk());
  record_.Lift();
  while (log_->Read().failing) std::this_thread::yield();
  EXPECT_THAT(Events(), ElementsAre("open", "call", "refused", "close"));
  EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
}

TEST_F(AuditObserverTest, ReportsLostEventsAsAnEvent) {
  const auto event = nlohmann::json::parse(AuditObserver::LostEvent(3));
  EXPECT_EQ(event.at("event"), "lost");
  EXPECT_EQ(event.at("count"), 3);
}

TEST_F(AuditObserverTest, OverlongAndStrangeNamesStayOneLineOfAscii) {
  const std::vector<std::string> names = {std::string(100'000, '"'), "\n\xff\xc3\xa4"};
  for (const std::string& name : names) {
    principal_.name = name;
    EXPECT_THAT(Run("SessionService.GetSession"), IsOk());
  }
  ASSERT_TRUE(log_->Flush());
  for (const std::string& text : record_.messages()) {
    EXPECT_LT(text.size(), 8192);
    for (const char c : text) EXPECT_TRUE(c >= ' ' && c <= '~') << text;
  }
  EXPECT_EQ(Lines().size(), 2);
}

}  // namespace
}  // namespace tissueform
