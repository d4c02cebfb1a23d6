// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/session_call.h"

#include <optional>
#include <string>
#include <vector>

#include "gtest/gtest.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kAtOnce{0};

absl::Status Moved(const std::string& node) {
  return WithReason(absl::UnavailableError("moved"), ErrorReason::kSessionMoved,
                    node.empty() ? ErrorMetadata() : ErrorMetadata{{"node", node}});
}
absl::Status Full(const std::string& node) {
  return WithReason(absl::ResourceExhaustedError("full"), ErrorReason::kMemoryBudgetFull,
                    node.empty() ? ErrorMetadata() : ErrorMetadata{{"node", node}});
}

class SessionAttemptsTest : public ::testing::Test {
 protected:
  SessionAttempts Attempts(CallRepeat repeat) {
    return SessionAttempts(&routes_, "sessions/a", repeat);
  }
  // Whether there is another attempt, after a wait.
  static bool Waits(std::optional<std::chrono::milliseconds> wait) {
    return wait.has_value() && *wait > kAtOnce;
  }

  SessionRoutes routes_;
};

TEST_F(SessionAttemptsTest, StandaloneServerIsAskedOnce) {
  for (const absl::Status& error :
       {absl::UnavailableError(""), absl::InternalError(""), absl::NotFoundError(""), Full(""),
        WithReason(absl::UnavailableError(""), ErrorReason::kServerDraining)}) {
    EXPECT_FALSE(Attempts(CallRepeat::kAlways).AfterError(error).has_value()) << error;
  }
}

TEST_F(SessionAttemptsTest, FollowsANamedServerImmediatelyAFewTimes) {
  for (const absl::Status& error : {Moved("two"), Full("two")}) {
    SessionAttempts attempts = Attempts(CallRepeat::kIfNothingWasDone);
    for (int hop = 0; hop < kMaxHops; ++hop) {
      EXPECT_EQ(attempts.AfterError(error), kAtOnce);
      EXPECT_EQ(routes_.NodeOf("sessions/a"), "two");
    }
    EXPECT_NE(attempts.AfterError(error), kAtOnce) << "two servers that name each other";
  }
}

TEST_F(SessionAttemptsTest, RetriesAnUnlocatedSessionImmediatelyAndThenWaits) {
  SessionAttempts attempts = Attempts(CallRepeat::kIfNothingWasDone);
  EXPECT_EQ(attempts.AfterError(Moved("")), kAtOnce);
  EXPECT_TRUE(Waits(attempts.AfterError(Moved(""))));
}

TEST_F(SessionAttemptsTest, WithoutPatienceAnUnlocatedSessionIsTriedOnce) {
  SessionAttempts attempts(&routes_, "sessions/a", CallRepeat::kAlways, kNoPatience);
  EXPECT_FALSE(attempts.AfterError(Moved("")).has_value());
}

TEST_F(SessionAttemptsTest, RepeatsUnstartedCallsButNotPossiblyCompletedOnes) {
  routes_.Remember("sessions/a", "one");
  for (const ErrorReason reason : {ErrorReason::kWrongNode, ErrorReason::kServerDraining}) {
    const absl::Status error = WithReason(absl::UnavailableError(""), reason);
    EXPECT_TRUE(Waits(Attempts(CallRepeat::kIfNothingWasDone).AfterError(error))) << error;
    EXPECT_TRUE(Waits(Attempts(CallRepeat::kAlways).AfterError(error))) << error;
  }
  for (const absl::Status& lost :
       {absl::UnavailableError(""), absl::UnknownError(""), absl::InternalError("")}) {
    EXPECT_FALSE(Attempts(CallRepeat::kIfNothingWasDone).AfterError(lost).has_value()) << lost;
    EXPECT_TRUE(Waits(Attempts(CallRepeat::kAlways).AfterError(lost))) << lost;
  }
}

TEST_F(SessionAttemptsTest, DoesNotRepeatARefusedCall) {
  routes_.Remember("sessions/a", "one");
  for (const absl::Status& error : {absl::NotFoundError(""), absl::InvalidArgumentError(""),
                                    absl::AbortedError(""), absl::DeadlineExceededError(""),
                                    absl::DataLossError(""), absl::CancelledError(""), Full("")}) {
    EXPECT_FALSE(Attempts(CallRepeat::kAlways).AfterError(error).has_value()) << error;
  }
}

TEST_F(SessionAttemptsTest, WaitsGrowAndEndWithThePatience) {
  routes_.Remember("sessions/a", "one");
  SessionAttempts patient = Attempts(CallRepeat::kAlways);
  const auto first = patient.AfterError(absl::UnavailableError(""));
  ASSERT_TRUE(first.has_value());
  for (int i = 0; i < 10; ++i) patient.AfterError(absl::UnavailableError(""));
  const auto later = patient.AfterError(absl::UnavailableError(""));
  ASSERT_TRUE(later.has_value());
  EXPECT_GT(*later, *first);
  SessionAttempts hasty(&routes_, "sessions/a", CallRepeat::kAlways, kNoPatience);
  EXPECT_FALSE(hasty.AfterError(absl::UnavailableError("")).has_value());
}

TEST(CallRepeatTest, ANewSessionOfAClusterIsGivenARequestId) {
  SessionRoutes routes;
  v1::CreateSessionRequest request;
  EXPECT_EQ(PrepareToRepeat(routes, &request), CallRepeat::kIfNothingWasDone);
  EXPECT_EQ(request.request_id(), "") << "a server alone is asked as before";
  routes.Remember("", "one");
  EXPECT_EQ(PrepareToRepeat(routes, &request), CallRepeat::kAlways);
  EXPECT_EQ(request.request_id().size(), 32U);
  v1::CreateSessionRequest other;
  PrepareToRepeat(routes, &other);
  EXPECT_NE(request.request_id(), other.request_id());
  v1::CreateSessionRequest named;
  named.set_request_id("mine");
  EXPECT_EQ(PrepareToRepeat(SessionRoutes(), &named), CallRepeat::kAlways);
  EXPECT_EQ(named.request_id(), "mine");
}

TEST(CallRepeatTest, AnUpdateWithAnEtagIsNotRepeatedAfterALoss) {
  v1::UpdateSessionRequest request;
  EXPECT_EQ(RepeatOf(request), CallRepeat::kAlways);
  request.set_etag("1");
  EXPECT_EQ(RepeatOf(request), CallRepeat::kIfNothingWasDone);
}

}  // namespace
}  // namespace tissueform
