// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/call_scope.h"

#include <chrono>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "spdlog/sinks/ostream_sink.h"
#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

// A call that is refused or served, and over.
absl::StatusCode AdmissionOf(CallKind kind, AdmissionControl* gate) {
  CallScope scope(nullptr, "Test.Call", kind, gate);
  const absl::StatusCode code = scope.admission().code();
  EXPECT_EQ(scope.End(scope.admission()).ok(), code == absl::StatusCode::kOk);
  return code;
}

TEST(CallScopeTest, ADrainingServerRefusesOnlyNewWork) {
  AdmissionControl gate;
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kOk);
  gate.StartDraining();
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kUnavailable);
  EXPECT_EQ(AdmissionOf(CallKind::kMetadata, &gate), absl::StatusCode::kOk);
}

TEST(CallScopeTest, EndConvertsTheOutcome) {
  AdmissionControl gate;
  CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_EQ(scope.End(absl::NotFoundError("gone")).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(CallScopeTest, TheGateIsIdleWhenTheLastCallHasEnded) {
  AdmissionControl gate;
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
  AdmissionControl gate;
  const auto at_once = std::chrono::steady_clock::now();
  {
    CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
    const CallScope moved = std::move(scope);
    EXPECT_FALSE(gate.WaitUntilIdle(at_once));
  }
  EXPECT_TRUE(gate.WaitUntilIdle(at_once)) << "once, not twice";
}

TEST(CallScopeTest, CallerIsAnonymousWithoutLogins) {
  AdmissionControl gate;
  const CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_TRUE(scope.principal().anonymous());
}

// Takes "Bearer NAME" for the token of NAME.
class TrustingAuthenticator : public Authenticator {
 public:
  absl::StatusOr<Authenticated> Authenticate(const Credentials& credentials) override {
    if (credentials.authorization.size() != 1) return absl::UnauthenticatedError("no token");
    Principal principal{
        .name = std::string(absl::StripPrefix(credentials.authorization[0], "Bearer "))};
    return Authenticated{.principal = std::make_shared<const Principal>(std::move(principal))};
  }
  absl::Status IsStillAuthorized(const Authenticated& /*authenticated*/) override {
    return absl::OkStatus();
  }
};

TEST(CallScopeTest, ServerWithLoginsRefusesUnauthenticatedCalls) {
  TrustingAuthenticator authenticator;
  AdmissionControl gate({.authenticator = &authenticator});
  EXPECT_EQ(AdmissionOf(CallKind::kMetadata, &gate), absl::StatusCode::kUnauthenticated);
}

TEST(CallScopeTest, AStreamGoesOnWithATokenOfTheSamePrincipalOnly) {
  TrustingAuthenticator authenticator;
  AdmissionControl gate({.authenticator = &authenticator});
  CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  EXPECT_TRUE(absl::IsUnauthenticated(scope.Renew("somebody")));
  AdmissionControl without_logins;
  CallScope open(nullptr, "Test.Call", CallKind::kNewWork, &without_logins);
  EXPECT_TRUE(open.Renew("somebody").ok());
  EXPECT_TRUE(open.principal().anonymous());
}

// Writes down what it observes.
class Notes : public CallObserver {
 public:
  absl::Status OnBegin(const ObservedCall& call) override {
    events.push_back(
        absl::StrCat("begin ", std::string(call.method), " ", std::string(call.resource)));
    return refusal;
  }
  void OnResource(const ObservedCall& call) override {
    events.push_back(absl::StrCat("resource ", std::string(call.resource)));
  }
  void OnEnd(const ObservedCall& call, const absl::Status& outcome,
             std::chrono::steady_clock::duration /*elapsed*/) override {
    events.push_back(absl::StrCat("end ", std::string(call.resource), " ",
                                  absl::StatusCodeToString(outcome.code())));
  }

  absl::Status refusal;
  std::vector<std::string> events;
};

TEST(CallScopeTest, AnObserverHearsOfEveryCallOnce) {
  Notes notes;
  AdmissionControl gate({.observer = &notes});
  CallScope scope(nullptr, "Test.Call", CallKind::kNewWork, &gate);
  CallScope moved = std::move(scope);
  moved.SetResource("sessions/a");
  EXPECT_FALSE(moved.End(absl::NotFoundError("gone")).ok());
  EXPECT_THAT(notes.events, ::testing::ElementsAre("begin Test.Call ", "resource sessions/a",
                                                   "end sessions/a NOT_FOUND"));
}

TEST(CallScopeTest, AnObserverCanRefuseACall) {
  Notes notes;
  notes.refusal = absl::UnavailableError("the audit log cannot be written");
  AdmissionControl gate({.observer = &notes});
  EXPECT_EQ(AdmissionOf(CallKind::kMetadata, &gate), absl::StatusCode::kUnavailable);
  EXPECT_EQ(notes.events.size(), 2);
}

TEST(CallScopeTest, ACallWithoutRequestIdGetsOneOfItsOwn) {
  AdmissionControl gate;
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
  AdmissionControl gate;
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
