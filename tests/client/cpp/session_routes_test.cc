// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/session_routes.h"

#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

absl::Status Moved(const ErrorMetadata& metadata) {
  return WithReason(absl::UnavailableError("moved"), ErrorReason::kSessionMoved, metadata);
}

TEST(SessionRoutesTest, TheNodeThatAnsweredLastIsRemembered) {
  SessionRoutes routes;
  EXPECT_EQ(routes.NodeOf("sessions/a"), "");
  EXPECT_FALSE(routes.in_cluster());
  routes.Remember("sessions/a", "one:1");
  routes.Remember("sessions/a", "two:1");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "two:1");
  EXPECT_TRUE(routes.in_cluster());
  routes.Forget("sessions/a");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "");
  EXPECT_EQ(routes.size(), 0U);
}

TEST(SessionRoutesTest, DoesNotRememberANameThatIsInvalidInAHeader) {
  SessionRoutes routes;
  for (const std::string& name : {std::string(), std::string("a b"), std::string("a\nb"),
                                  std::string("a\0b", 3), std::string(65, 'a')}) {
    routes.Remember("sessions/a", name);
    routes.LearnFrom(Moved({{"node", "a b"}}), "sessions/a");
    EXPECT_EQ(routes.NodeOf("sessions/a"), "") << name;
  }
  routes.Remember("sessions/a", std::string(64, 'a'));
  EXPECT_EQ(routes.NodeOf("sessions/a"), std::string(64, 'a'));
}

TEST(SessionRoutesTest, TheSessionsThatWereUsedLastStay) {
  SessionRoutes routes(2);
  routes.Remember("sessions/a", "one");
  routes.Remember("sessions/b", "one");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "one");
  routes.Remember("sessions/c", "one");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "one");
  EXPECT_EQ(routes.NodeOf("sessions/b"), "");
  EXPECT_EQ(routes.NodeOf("sessions/c"), "one");
  EXPECT_EQ(routes.size(), 2U);
}

TEST(SessionRoutesTest, AnErrorSaysWhereToGoOrThatItIsNotThere) {
  SessionRoutes routes;
  routes.Remember("sessions/a", "one");
  routes.LearnFrom(Moved({{"node", "two"}}), "sessions/a");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "two");
  routes.LearnFrom(Moved({}), "sessions/a");
  EXPECT_EQ(routes.NodeOf("sessions/a"), "");
  for (const absl::Status& error :
       {absl::UnavailableError(""), absl::UnknownError(""), absl::InternalError(""),
        WithReason(absl::UnavailableError(""), ErrorReason::kWrongNode)}) {
    routes.Remember("sessions/a", "one");
    routes.LearnFrom(error, "sessions/a");
    EXPECT_EQ(routes.NodeOf("sessions/a"), "") << error;
  }
}

TEST(SessionRoutesTest, KeepsTheRouteAfterTheServersRefusal) {
  SessionRoutes routes;
  routes.Remember("sessions/a", "one");
  for (const absl::Status& error :
       {absl::OkStatus(), absl::NotFoundError(""), absl::CancelledError(""),
        absl::InvalidArgumentError(""), absl::ResourceExhaustedError("")}) {
    routes.LearnFrom(error, "sessions/a");
    EXPECT_EQ(routes.NodeOf("sessions/a"), "one") << error;
  }
}

TEST(SessionRoutesTest, FollowsOnlyErrorsThatRedirectToAnotherServer) {
  EXPECT_EQ(NodeIn(Moved({{"node", "two"}})), "two");
  EXPECT_EQ(NodeIn(WithReason(absl::ResourceExhaustedError(""), ErrorReason::kMemoryBudgetFull,
                              {{"node", "two"}})),
            "two");
  EXPECT_EQ(
      NodeIn(WithReason(absl::NotFoundError(""), ErrorReason::kSessionNotFound, {{"node", "two"}})),
      "");
  EXPECT_EQ(NodeIn(absl::UnavailableError("")), "");
}

TEST(SessionRoutesTest, RespectsTheLimitUnderConcurrentUse) {
  SessionRoutes routes(100);
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&routes, t] {
      for (int i = 0; i < 2'000; ++i) {
        const std::string session = absl::StrCat("sessions/", t, "-", i % 150);
        routes.Remember(session, "one");
        routes.NodeOf(session);
        if (i % 7 == 0) routes.Forget(session);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(routes.size(), 100U);
  EXPECT_GT(routes.size(), 0U);
}

}  // namespace
}  // namespace tissueform
