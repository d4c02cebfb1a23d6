// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <set>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/gateway/gateway_test.h"

// Which of several servers calls go to, as browsers see it.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr char kEchoOfNode[] = "/tissueform.v1.MeshService/GetMesh";

// A gateway before two servers of a cluster, both known to be healthy.
class GatewayClusterTest : public GatewayTest {
 protected:
  GatewayClusterTest() : first_("first"), second_("second") {
    GatewayOptions options;
    options.servers = {"first=" + first_.address(), "second=" + second_.address()};
    options.port = 0;
    cluster_ = *Gateway::Start(options);
    EXPECT_TRUE(Becomes([&] { return NodeOf("first") == "first"; }));
    EXPECT_TRUE(Becomes([&] { return NodeOf("second") == "second"; }));
  }

  // What is answered to a call of this session that names this node; empty: names none.
  std::string AskNode(const std::string& node, const std::string& session = "") {
    return AskWeb(cluster_->port(), kEchoOfNode, WebBody("abc"),
                  (node.empty() ? "" : "x-tissueform-node: " + node + "\r\n") +
                      (session.empty() ? "" : "x-tissueform-session: " + session + "\r\n"));
  }
  // Who has answered; empty: nobody.
  std::string NodeOf(const std::string& node, const std::string& session = "") {
    const std::string reply = AskNode(node, session);
    const std::string field = "x-tissueform-node: ";
    const size_t at = reply.find(field);
    if (at == std::string::npos) return {};
    return reply.substr(at + field.size(), reply.find('\r', at) - at - field.size());
  }

  FakeServer first_;
  FakeServer second_;
  std::unique_ptr<Gateway> cluster_;
};

TEST_F(GatewayClusterTest, ACallThatNamesANodeGoesThereAlone) {
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(NodeOf("first", absl::StrCat("s", i)), "first");
    EXPECT_EQ(NodeOf("second", absl::StrCat("s", i)), "second");
  }
}

TEST_F(GatewayClusterTest, AForgedNodeIsWrongAndReachesNobody) {
  // Counted before, too: while the health of the two was not known yet.
  const int64_t before = cluster_->counters().Count(GatewayEvent::kWrongNode);
  const std::string reply = AskNode("third", "s1");
  EXPECT_THAT(reply, HasSubstr("grpc-status: 14\r\n"));
  std::string details;
  const std::string field = "grpc-status-details-bin: ";
  const size_t at = reply.find(field) + field.size();
  ASSERT_TRUE(absl::Base64Unescape(reply.substr(at, reply.find('\r', at) - at), &details));
  EXPECT_THAT(details, HasSubstr("WRONG_NODE"));
  EXPECT_EQ(cluster_->counters().Count(GatewayEvent::kWrongNode), before + 1);
}

TEST_F(GatewayClusterTest, CallsWithoutASessionAreSpread) {
  std::set<std::string> answered;
  for (int i = 0; i < 4; ++i) answered.insert(NodeOf(""));
  EXPECT_EQ(answered, (std::set<std::string>{"first", "second"}));
}

TEST_F(GatewayClusterTest, SessionsOfANodeThatLeavesGoToTheOther) {
  first_.SetServing(false);
  ASSERT_TRUE(Becomes([&] { return NodeOf("first").empty(); }));
  for (int i = 0; i < 8; ++i) EXPECT_EQ(NodeOf("", absl::StrCat("s", i)), "second");
  first_.SetServing(true);
  EXPECT_TRUE(Becomes([&] { return NodeOf("first") == "first"; }));
}

TEST_F(GatewayClusterTest, NamesOfNodesThatAreNoneAreRefusedAtTheStart) {
  GatewayOptions options;
  options.servers = {"a=127.0.0.1:1", "a=127.0.0.1:2"};
  options.port = 0;
  EXPECT_EQ(Gateway::Start(options).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tissueform::testing
