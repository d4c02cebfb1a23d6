// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/call_quotas.h"

#include <chrono>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "server/access/auth/authenticator.h"
#include "server/rpc/calls/call_scope.h"
#include "tests/testing/fake_clock.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

constexpr Quotas kSmall = {.calls_per_second = 10, .waiting_calls = 3, .streams = 2};

class CallQuotasTest : public ::testing::Test {
 protected:
  // Calls of this kind that are let in, one after the other.
  int LetIn(const std::string& principal, int tried) {
    int let_in = 0;
    for (int i = 0; i < tried; ++i) {
      if (!quotas_.Begin(principal, CallKind::kMetadata).ok()) continue;
      quotas_.End(principal, CallKind::kMetadata);
      ++let_in;
    }
    return let_in;
  }

  testing::FakeClock clock_;
  CallQuotas quotas_{kSmall, &clock_};
};

TEST_F(CallQuotasTest, CallsASecondAreThoseOfTheQuotaWithABurstOfTwoSeconds) {
  EXPECT_EQ(LetIn("a", 100), 20);
  EXPECT_EQ(LetIn("a", 100), 0);
  clock_.Advance(std::chrono::milliseconds(500));
  EXPECT_EQ(LetIn("a", 100), 5);
  clock_.Advance(std::chrono::hours(1));
  EXPECT_EQ(LetIn("a", 100), 20) << "no more than the burst, however long nobody called";
}

TEST_F(CallQuotasTest, OnePrincipalTakesNothingFromAnother) {
  EXPECT_EQ(LetIn("a", 100), 20);
  EXPECT_EQ(LetIn("b", 100), 20);
}

TEST_F(CallQuotasTest, ARefusalSaysWhichQuotaAndWhenToTryAgain) {
  LetIn("a", 20);
  const absl::Status status = quotas_.Begin("a", CallKind::kMetadata);
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  const ErrorInfo info = ErrorInfoOf(status);
  EXPECT_EQ(info.reason, "QUOTA_EXCEEDED");
  EXPECT_EQ(info.metadata.at("quota"), "calls-per-second");
  EXPECT_EQ(info.metadata.at("limit"), "10");
  EXPECT_EQ(info.metadata.at("retry_after_ms"), "100");
  EXPECT_THAT(std::string(status.message()), HasSubstr("--quota-calls-per-second"));
  clock_.Advance(std::chrono::milliseconds(100));
  EXPECT_TRUE(quotas_.Begin("a", CallKind::kMetadata).ok()) << "as it was told";
}

TEST_F(CallQuotasTest, StreamsAndOtherCallsHavePlacesOfTheirOwn) {
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(quotas_.Begin("a", CallKind::kNewWork).ok());
  EXPECT_FALSE(quotas_.Begin("a", CallKind::kMetadata).ok());
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(quotas_.Begin("a", CallKind::kStream).ok());
  EXPECT_FALSE(quotas_.Begin("a", CallKind::kStream).ok());
  EXPECT_EQ(quotas_.open_streams("a"), 2);
  quotas_.End("a", CallKind::kStream);
  EXPECT_TRUE(quotas_.Begin("a", CallKind::kStream).ok());
  quotas_.End("a", CallKind::kNewWork);
  EXPECT_TRUE(quotas_.Begin("a", CallKind::kMetadata).ok());
}

TEST_F(CallQuotasTest, ForgetsIdlePrincipalsButNotOnesWithAnOpenCall) {
  for (int i = 0; i < 1000; ++i) LetIn("gone " + std::to_string(i), 1);
  EXPECT_TRUE(quotas_.Begin("here", CallKind::kStream).ok());
  EXPECT_EQ(quotas_.num_principals(), 1001);
  clock_.Advance(std::chrono::minutes(2));
  LetIn("other", 1);
  EXPECT_EQ(quotas_.num_principals(), 2);
  EXPECT_EQ(quotas_.open_streams("here"), 1);
}

// Every caller is "a".
class OnePrincipal : public Authenticator {
 public:
  absl::StatusOr<Authenticated> Authenticate(const Credentials& /*credentials*/) override {
    return Authenticated{.principal = std::make_shared<const Principal>(Principal{.name = "a"})};
  }
  absl::Status IsStillAuthorized(const Authenticated& /*authenticated*/) override {
    return absl::OkStatus();
  }
};

TEST_F(CallQuotasTest, ACallThatIsOverGivesItsPlaceBackOnce) {
  OnePrincipal authenticator;
  AdmissionControl gate({.authenticator = &authenticator, .quotas = &quotas_});
  {
    CallScope first(nullptr, "Test.Stream", CallKind::kStream, &gate);
    CallScope second(nullptr, "Test.Stream", CallKind::kStream, &gate);
    const CallScope moved = std::move(second);
    CallScope third(nullptr, "Test.Stream", CallKind::kStream, &gate);
    EXPECT_TRUE(absl::IsResourceExhausted(third.admission()));
    EXPECT_FALSE(third.End(third.admission()).ok());
    EXPECT_EQ(quotas_.open_streams("a"), 2) << "one that was refused had no place";
    EXPECT_TRUE(first.End(absl::OkStatus()).ok());
    EXPECT_EQ(quotas_.open_streams("a"), 1);
  }
  EXPECT_EQ(quotas_.open_streams("a"), 0);
}

TEST_F(CallQuotasTest, AnonymousCallersHaveNoQuota) {
  AdmissionControl gate({.quotas = &quotas_});
  for (int i = 0; i < 100; ++i) {
    CallScope scope(nullptr, "Test.Call", CallKind::kMetadata, &gate);
    EXPECT_TRUE(scope.End(scope.admission()).ok());
  }
  EXPECT_EQ(quotas_.num_principals(), 0);
}

}  // namespace
}  // namespace tissueform
