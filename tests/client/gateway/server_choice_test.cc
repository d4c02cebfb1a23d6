// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/server_choice.h"

#include <map>
#include <set>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

bool All(size_t /*place*/) { return true; }
bool None(size_t /*place*/) { return false; }

std::vector<NodeAddress> ThreeNodes() {
  return {{.node = "a", .address = "h:1"},
          {.node = "b", .address = "h:2"},
          {.node = "c", .address = "h:3"}};
}

std::string SessionNumber(int i) { return "session" + std::to_string(i); }

TEST(NodeAddress, MayHaveANodesName) {
  EXPECT_EQ(ParseNodeAddress("host:1").node, "");
  EXPECT_EQ(ParseNodeAddress("host:1").address, "host:1");
  EXPECT_EQ(ParseNodeAddress("node-1=host:1").node, "node-1");
  EXPECT_EQ(ParseNodeAddress("node-1=host:1").address, "host:1");
  EXPECT_EQ(ParseNodeAddress("n=unix:/a=b").address, "unix:/a=b");
  EXPECT_EQ(ParseNodeAddress("unix:/a=b").address, "unix:/a=b");
  EXPECT_EQ(ParseNodeAddress("unix:/a=b").node, "");
}

struct BadServers {
  const char* name;
  std::vector<std::string> servers;
  const char* message;
};

class BadServersTest : public ::testing::TestWithParam<BadServers> {};

TEST_P(BadServersTest, AreRefusedByName) {
  std::vector<NodeAddress> servers;
  for (const std::string& text : GetParam().servers) servers.push_back(ParseNodeAddress(text));
  EXPECT_THAT(ServerChoice::Check(servers),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    Servers, BadServersTest,
    ::testing::Values(BadServers{"NoAddress", {"a="}, "has no address"},
                      BadServers{"Nothing", {""}, "has no address"},
                      BadServers{"NoPort", {"a=h"}, "give HOST:PORT"},
                      BadServers{"PortBeyondAll", {"h:99999"}, "give HOST:PORT"},
                      BadServers{"Space", {"a b=h:1"}, "letters"},
                      BadServers{"LongName", {std::string(65, 'n') + "=h:1"}, "64"},
                      BadServers{"TwoOfOneName", {"a=h:1", "a=h:2"}, "duplicate name"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(ServerChoice, TakesNamesAsServersHaveThem) {
  EXPECT_TRUE(ServerChoice::Check(ThreeNodes()).ok());
  EXPECT_TRUE(ServerChoice::Check({ParseNodeAddress("rack-1.b_2:50051=h:1")}).ok());
  EXPECT_TRUE(ServerChoice::Check({{.address = "h:1"}, {.address = "unix:/run/h"}}).ok());
}

TEST(ServerChoice, ANodeIsStrict) {
  ServerChoice choice(ThreeNodes());
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(*choice.Choose(SessionNumber(i), "b", All), 1U);
    EXPECT_EQ(*choice.Choose("", "c", All), 2U);
  }
}

TEST(ServerChoice, ANodeThatNobodyIsOrThatDoesNotServeIsWrong) {
  ServerChoice choice(ThreeNodes());
  const auto but_b = [](size_t place) { return place != 1; };
  for (const auto& status :
       {choice.Choose("s", "d", All).status(), choice.Choose("s", "b", but_b).status(),
        choice.Choose("s", std::string(100'000, 'x'), All).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
    EXPECT_TRUE(HasReason(status, ErrorReason::kWrongNode));
    EXPECT_LT(status.message().size(), 200U);
  }
}

// A proxy before the nodes knows them, or the server says itself that it is another one.
TEST(ServerChoice, ServersWithoutANameAreAskedForEveryOtherNode) {
  ServerChoice choice({{.node = "a", .address = "h:1"}, {.address = "h:2"}});
  EXPECT_EQ(*choice.Choose("s", "a", All), 0U);
  EXPECT_EQ(*choice.Choose("s", "b", All), 1U);
}

TEST(ServerChoice, CallsWithoutASessionAreSpreadOverThoseThatServe) {
  ServerChoice choice(ThreeNodes());
  std::map<size_t, int> calls;
  for (int i = 0; i < 30; ++i) ++calls[*choice.Choose("", "", All)];
  EXPECT_EQ(calls, (std::map<size_t, int>{{0, 10}, {1, 10}, {2, 10}}));
  calls.clear();
  const auto but_b = [](size_t place) { return place != 1; };
  for (int i = 0; i < 30; ++i) ++calls[*choice.Choose("", "", but_b)];
  EXPECT_EQ(calls, (std::map<size_t, int>{{0, 15}, {2, 15}}));
}

TEST(ServerChoice, OnlySessionsOfAServerThatDoesNotServeGoElsewhere) {
  ServerChoice choice(ThreeNodes());
  ServerChoice other_gateway(ThreeNodes());
  const auto but_b = [](size_t place) { return place != 1; };
  std::set<size_t> used;
  for (int i = 0; i < 60; ++i) {
    const size_t before = *choice.Choose(SessionNumber(i), "", All);
    EXPECT_EQ(*other_gateway.Choose(SessionNumber(i), "", All), before);
    const size_t after = *choice.Choose(SessionNumber(i), "", but_b);
    used.insert(before);
    EXPECT_TRUE(before == 1 ? after != 1 : after == before) << i;
  }
  EXPECT_EQ(used.size(), 3U);
}

TEST(ServerChoice, WhereNoneServesOneIsAskedAllTheSame) {
  ServerChoice choice(ThreeNodes());
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(*choice.Choose(SessionNumber(i), "", None),
              *choice.Choose(SessionNumber(i), "", All));
  }
  EXPECT_TRUE(choice.Choose("", "", None).ok());
}

}  // namespace
}  // namespace tissueform
