// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <filesystem>
#include <future>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/support/byte_buffer.h"
#include "gtest/gtest.h"

#include "client/cpp/client_call.h"
#include "core/base/process/child_process.h"
#include "server/cluster/cluster_options.h"
#include "server/cluster/node_table.h"
#include "tests/server/cluster/cluster_test.h"
#include "tests/server/store/postgres_store/test_database.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// How a server becomes a node of a cluster, and what it does when the database goes away.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Code = absl::StatusCode;

TEST(NodeNameTest, ANameIsShortAndPlain) {
  for (const char* good : {"a", "node-1.example_x:50051", "A"}) {
    EXPECT_THAT(CheckNodeName(good), IsOk()) << good;
  }
  for (const std::string& bad : {std::string(), std::string("a b"), std::string("a/b"),
                                 std::string("a\n"), std::string("ä"), std::string(65, 'a')}) {
    EXPECT_THAT(CheckNodeName(bad), StatusIs(Code::kInvalidArgument)) << bad;
  }
  EXPECT_THAT(CheckNodeName(DefaultNodeName(50051)), IsOk());
  EXPECT_THAT(DefaultNodeName(50051), ::testing::EndsWith(":50051"));
  EXPECT_NE(DefaultNodeName(0), DefaultNodeName(0)) << "the port is not known yet";
}

class ClusterStartTest : public ClusterTest {
 protected:
  // What the standard health service says: HealthCheckResponse{status: SERVING}.
  static bool IsServing(const TestNode& node) {
    grpc::GenericStub stub(grpc::CreateChannel(absl::StrCat("127.0.0.1:", node.server->port()),
                                               grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    const grpc::Slice empty;
    const grpc::ByteBuffer request(&empty, 1);
    grpc::ByteBuffer response;
    std::promise<grpc::Status> done;
    stub.UnaryCall(&context, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request,
                   &response, [&done](grpc::Status status) { done.set_value(std::move(status)); });
    grpc::Slice bytes;
    return done.get_future().get().ok() && response.DumpToSingleSlice(&bytes).ok() &&
           std::string(bytes.begin(), bytes.end()) == "\x08\x01";
  }
  absl::Status StartOf(const ServerOptions& options) {
    return TissueformServer::Start(options, &callers_).status();
  }
};

TEST_F(ClusterStartTest, RefusesADatabaseTogetherWithAFolderOrMemory) {
  ServerOptions options = NodeOptions("c");
  options.in_memory = true;
  EXPECT_THAT(StartOf(options), StatusIs(Code::kInvalidArgument, HasSubstr("--store")));
  options.in_memory = false;
  options.data_dir = "/tmp/somewhere";
  EXPECT_THAT(StartOf(options), StatusIs(Code::kInvalidArgument, HasSubstr("--store")));
}

TEST_F(ClusterStartTest, WaitsALimitedTimeForAnUnavailableDatabase) {
  ServerOptions options = NodeOptions("c");
  options.cluster.store = "postgresql://postgres@127.0.0.1:1/postgres";
  options.cluster.start_patience = std::chrono::milliseconds(700);
  EXPECT_THAT(StartOf(options),
              StatusIs(Code::kUnavailable, AllOf(HasSubstr("127.0.0.1:1"), HasSubstr("--store"))));
}

TEST_F(ClusterStartTest, TablesOfANewerServerAndAReplicaAreRefusedAtOnce) {
  RunOutsideTransaction("DROP DATABASE IF EXISTS odd WITH (FORCE)");
  RunOutsideTransaction("CREATE DATABASE odd");
  ServerOptions options = NodeOptions("c");
  options.cluster.store = TestDatabaseOptions("odd").url;
  ASSERT_THAT(StartOf(options), IsOk());
  RunOutsideTransaction("ALTER DATABASE odd SET default_transaction_read_only = on");
  EXPECT_THAT(StartOf(options), StatusIs(Code::kFailedPrecondition, HasSubstr("read-only")));
  RunOutsideTransaction("ALTER DATABASE odd RESET default_transaction_read_only");
  PostgresOutcome outcome = PostgresOutcome::kFailed;
  ASSERT_THAT((*PostgresConnection::Open(*TargetOf(TestDatabaseOptions("odd"))))
                  ->Transact(
                      [](PostgresTransaction& transaction) {
                        return transaction.Execute("UPDATE tissueform_version SET version = 99");
                      },
                      &outcome),
              IsOk());
  EXPECT_THAT(StartOf(options), StatusIs(Code::kFailedPrecondition, HasSubstr("newer server")));
}

TEST_F(ClusterStartTest, ADataFolderIsCarriedOverAndServedByNodes) {
  a_ = {};
  b_ = {};
  EmptyTestDatabase();
  const std::string folder = ::testing::TempDir() + "carried_over";
  std::filesystem::remove_all(folder);
  ServerOptions alone = NodeOptions("");
  alone.cluster = {};
  alone.data_dir = folder;
  std::string session;
  {
    const TestNode node = StartNode(alone);
    session = MakeSession(node, 1);
    RawDrag drag(node, session);
    ASSERT_TRUE(drag.Send(3, /*commit=*/true));
    ASSERT_TRUE(drag.WaitForCommit(3));
  }
  ChildOptions command;
  command.program = ProgramPath("tissueform-server");
  command.arguments = {"migrate", "--data-dir", folder, "--store", TestDatabaseOptions().url};
  ASSERT_OK_AND_ASSIGN(const auto child, ChildProcess::Start(command));
  ASSERT_EQ(child->Wait().exit_code, 0);
  a_ = StartNode(NodeOptions("a"));
  v1::GetSessionRequest get;
  get.set_name(session);
  v1::Session found;
  ASSERT_THAT(FromGrpcStatus(a_.stubs->sessions->GetSession(As().get(), get, &found)), IsOk());
  ASSERT_EQ(found.committed_poses_size(), 1);
  EXPECT_EQ(found.committed_poses(0).scale(), SomePose(3).scale);
  EXPECT_THAT(AskOnce(a_, session, 4), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto again, ChildProcess::Start(command));
  EXPECT_EQ(again->Wait().exit_code, 1) << "into an empty database only";
  command.arguments = {"backup", "--store", TestDatabaseOptions().url, folder + "-backup"};
  ASSERT_OK_AND_ASSIGN(const auto backup, ChildProcess::Start(command));
  EXPECT_EQ(backup->Wait().exit_code, 1);
  std::filesystem::remove_all(folder);
}

TEST_F(ClusterStartTest, NodesOfOneNameAreReportedAndStillHoldSessionsSeparately) {
  const TestNode other = StartNode(NodeOptions("a"));
  EXPECT_TRUE(Eventually([&] { return other.server->cluster()->node().nodes().IsNameTaken(); }));
  EXPECT_TRUE(Eventually([&] { return a_.server->cluster()->node().nodes().IsNameTaken(); }));
  const std::string session = MakeSession(a_, 1);
  RawDrag drag(a_, session);
  ASSERT_TRUE(drag.Send(1));
  ASSERT_TRUE(drag.ReceiveFrame(1).has_value());
  EXPECT_THAT(AskOnce(other, session, 1), StatusIs(Code::kUnavailable));
  ASSERT_TRUE(drag.Send(2));
  EXPECT_TRUE(drag.ReceiveFrame(2).has_value());
}

TEST_F(ClusterStartTest, ANodeThatWasKilledDoesNotKeepItsName) {
  RunSql(
      "INSERT INTO nodes (holder, name, free_bytes, draining, seen) VALUES ('killed', 'c', 0, "
      "false, tissueform_now())");
  const TestNode node = StartNode(NodeOptions("c"));
  NodeTable& nodes = node.server->cluster()->node().nodes();
  ASSERT_TRUE(Eventually([&] { return nodes.CountOthers() == 3; })) << "the killed one, too";
  // Longer than a twin goes unseen.
  for (const auto end = std::chrono::steady_clock::now() + 3 * NodeTable::kEvery;
       std::chrono::steady_clock::now() < end;) {
    ASSERT_FALSE(nodes.IsNameTaken());
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

TEST_F(ClusterStartTest, NodeStatesItsNameAndRefusesCallsForAnother) {
  const std::string session = MakeSession(a_, 1);
  v1::GetSessionRequest get;
  get.set_name(session);
  v1::Session found;
  auto context = As();
  ASSERT_TRUE(a_.stubs->sessions->GetSession(context.get(), get, &found).ok());
  const auto said = context->GetServerInitialMetadata().find("x-tissueform-node");
  ASSERT_NE(said, context->GetServerInitialMetadata().end());
  EXPECT_EQ(said->second, "a");
  context = As();
  context->AddMetadata("x-tissueform-node", "b");
  EXPECT_THAT(FromGrpcStatus(a_.stubs->sessions->GetSession(context.get(), get, &found)),
              StatusIs(Code::kUnavailable));
}

TEST_F(ClusterStartTest, TheMetricsPageReportsLeases) {
  ServerOptions options = NodeOptions("c");
  options.telemetry.metrics_port = 0;
  const TestNode node = StartNode(options);
  MakeSession(node, 1);
  EXPECT_TRUE(Eventually([&] {
    return absl::StrContains(HttpGet(node.server->metrics_port(), "/metrics"),
                             "tissueform_other_nodes 2\n");
  }));
  const std::string page = HttpGet(node.server->metrics_port(), "/metrics");
  for (const char* line :
       {"\ntissueform_sessions_held 1\n", "\ntissueform_sessions_lost_total 0\n",
        "\ntissueform_lease_calls_total{call=\"take\",outcome=\"mine\"} 1\n",
        "\ntissueform_lease_calls_total{call=\"renew\",outcome=\"failed\"} 0\n",
        "\ntissueform_lease_renewal_age_seconds ", "\ntissueform_node_name_taken 0\n",
        "\ntissueform_row_lookups_total ", "\ntissueform_store_latency_seconds_count "}) {
    EXPECT_THAT(page, HasSubstr(line));
  }
}

TEST_F(ClusterStartTest, NodeResumesServingWhenTheDatabaseReturns) {
  a_ = {};
  FrozenProxy proxy(TestDatabasePort());
  ServerOptions options = NodeOptions("a");
  options.cluster.store =
      absl::StrCat("postgresql://postgres@127.0.0.1:", proxy.port(), "/postgres");
  a_ = StartNode(options);
  const std::string session = MakeSession(a_, 1);
  ASSERT_THAT(AskOnce(a_, session, 1), IsOk());
  proxy.FreezeAll();
  const CountedLeases::Counts& counts = a_.server->cluster()->node().leases().counts();
  const int64_t failed = counts.renewals_failed;
  EXPECT_TRUE(Eventually([&] { return counts.renewals_failed > failed; }));
  EXPECT_TRUE(Eventually([&] { return a_.server->cluster()->node().held() == 0; }));
  // Proxies see it, and send calls to others.
  EXPECT_TRUE(Eventually([&] { return !IsServing(a_); }));
  EXPECT_TRUE(IsServing(b_));
  proxy.Thaw();
  EXPECT_TRUE(Eventually([&] { return IsServing(a_); }));
  EXPECT_TRUE(Eventually([&] { return AskOnce(a_, session, 2).ok(); }));
  a_ = {};  // before the proxy
}

}  // namespace
}  // namespace tissueform::testing
