// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/call_scope.h"

#include <chrono>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "spdlog/sinks/ostream_sink.h"
#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

// A call that is refused or served, and over.
absl::StatusCode AdmissionOf(CallKind kind, ServiceGate* gate) {
  CallScope scope(nullptr, "Test.Call", kind, gate);
  const absl::StatusCode code = scope.admission().code();
  EXPECT_EQ(scope.End(scope.admission()).ok(), code == absl::StatusCode::kOk);
  return code;
}

TEST(CallScopeTest, ADrainingServerRefusesOnlyNewWork) {
  ServiceGate gate;
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kOk);
  gate.StartDraining();
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kUnavailable);
  EXPECT_EQ(AdmissionOf(CallKind::kUpkeep, &gate), absl::StatusCode::kOk);
}

TEST(CallScopeTest, EndConvertsTheOutcome) {
  ServiceGate gate;
  CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_EQ(scope.End(absl::NotFoundError("gone")).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(CallScopeTest, TheGateIsIdleWhenTheLastCallHasEnded) {
  ServiceGate gate;
  const auto at_once = std::chrono::steady_clock::now();
  EXPECT_TRUE(gate.WaitUntilIdle(at_once));
  CallScope first(nullptr, "Test.First", CallKind::kNewWork, &gate);
  CallScope second(nullptr, "Test.Second", CallKind::kNewWork, &gate);
  EXPECT_TRUE(first.End(absl::OkStatus()).ok());
  EXPECT_FALSE(gate.WaitUntilIdle(at_once));
  std::thread ends_later([&second] { EXPECT_TRUE(second.End(absl::OkStatus()).ok()); });
  EXPECT_TRUE(gate.WaitUntilIdle(at_once + std::chrono::seconds(30)));
  ends_later.join();
}

TEST(CallScopeTest, AScopeThatIsLeftEndsItsCall) {
  ServiceGate gate;
  const auto at_once = std::chrono::steady_clock::now();
  {
    CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
    const CallScope moved = std::move(scope);
    EXPECT_FALSE(gate.WaitUntilIdle(at_once));
  }
  EXPECT_TRUE(gate.WaitUntilIdle(at_once)) << "once, not twice";
}

TEST(CallScopeTest, EverybodyIsAnonymous) {
  ServiceGate gate;
  const CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_TRUE(scope.principal().anonymous());
}

TEST(CallScopeTest, ACallWithoutRequestIdGetsOneOfItsOwn) {
  ServiceGate gate;
  const CallScope one(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  const CallScope other(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_THAT(one.request_id(), ::testing::MatchesRegex("[0-9a-f]{32}"));
  EXPECT_NE(one.request_id(), other.request_id());
}

TEST(CallScopeTest, TheLogNamesTheRequest) {
  std::ostringstream text;
  const auto before = spdlog::default_logger();
  const auto logger = std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text));
  spdlog::set_default_logger(logger);
  ServiceGate gate;
  CallScope failed(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  const std::string failed_id = failed.request_id();
  EXPECT_FALSE(failed.End(absl::NotFoundError("a name")).ok());
  std::string left_id;
  {
    const CallScope left(nullptr, "Test.Call", CallKind::kNewWork, &gate);
    left_id = left.request_id();
  }
  spdlog::set_default_logger(before);
  EXPECT_THAT(text.str(), ::testing::HasSubstr("NOT_FOUND"));
  EXPECT_THAT(text.str(), ::testing::HasSubstr(failed_id));
  EXPECT_THAT(text.str(), ::testing::HasSubstr(left_id));
  EXPECT_THAT(text.str(), ::testing::Not(::testing::HasSubstr("a name")));
}

TEST(CallScopeTest, OnlyWellFormedRequestIdsAreTaken) {
  for (const char* id : {"a", "0aZ-_.", "4f6c1d2e-98a7-4c55"}) {
    EXPECT_EQ(RequestIdOr(id), id);
  }
  EXPECT_EQ(RequestIdOr(std::string(64, 'x')), std::string(64, 'x'));
  for (const std::string& id :
       {std::string(), std::string(65, 'x'), std::string("a b"), std::string("a\nb"),
        std::string("a\0b", 3), std::string("{}"), std::string("\xc3\xa4")}) {
    EXPECT_THAT(RequestIdOr(id), ::testing::MatchesRegex("[0-9a-f]{32}"));
  }
}

}  // namespace
}  // namespace tissueform
