// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"
#include "spdlog/sinks/ostream_sink.h"
#include "spdlog/spdlog.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/calls/call_scope.h"
#include "tissueform/v1/server_info.grpc.pb.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// Refuses every caller, and counts them.
class NobodyComesIn final : public Authenticator {
 public:
  absl::StatusOr<Authenticated> Authenticate(const Credentials& /*credentials*/) override {
    ++asked;
    return absl::UnauthenticatedError("no token");
  }
  absl::Status IsStillAuthorized(const Authenticated& /*authenticated*/) override {
    return absl::OkStatus();
  }

  std::atomic<int> asked = 0;
};

// What a client sees of one call.
struct Reply {
  absl::Status status;
  std::vector<std::string> initial;  // the names of nodes, as they were said
  std::vector<std::string> trailing;
};

using ReplyMetadata = std::multimap<grpc::string_ref, grpc::string_ref>;

std::vector<std::string> NodesIn(const ReplyMetadata& metadata) {
  std::vector<std::string> nodes;
  const auto [begin, end] = metadata.equal_range(kNodeHeader);
  for (auto header = begin; header != end; ++header) {
    nodes.emplace_back(header->second.data(), header->second.size());
  }
  return nodes;
}

// A server of one rpc that does nothing.
class OneCallServer final : public v1::ServerInfoService::CallbackService {
 public:
  explicit OneCallServer(const CallChecks& checks) : gate_(checks) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  ~OneCallServer() override { server_->Shutdown(); }

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest* /*request*/,
                                          v1::ServerInfo* /*response*/) override {
    return HandleUnaryCall(context, "Test.Call", &gate_,
                           [this](const CallScope&, const FinishCall& end) {
                             ++served_;
                             end(absl::OkStatus());
                             return absl::OkStatus();
                           });
  }

  // With one header for each of `nodes`.
  Reply Call(const std::vector<std::string>& nodes) const {
    const auto stub = v1::ServerInfoService::NewStub(
        grpc::CreateChannel(absl::StrCat("127.0.0.1:", port_), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    for (const std::string& node : nodes) context.AddMetadata(kNodeHeader, node);
    v1::ServerInfo info;
    const grpc::Status status = stub->GetServerInfo(&context, {}, &info);
    return {FromGrpcStatus(status), NodesIn(context.GetServerInitialMetadata()),
            NodesIn(context.GetServerTrailingMetadata())};
  }

  int served() const { return served_; }

 private:
  AdmissionControl gate_;
  std::atomic<int> served_ = 0;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(NodeHeaderTest, AServerOfAClusterSaysItsNameInEveryReply) {
  const OneCallServer server({.node_name = "a:1"});
  for (const std::vector<std::string>& nodes :
       {std::vector<std::string>{}, std::vector<std::string>{"a:1"}}) {
    const Reply reply = server.Call(nodes);
    EXPECT_TRUE(reply.status.ok()) << reply.status;
    EXPECT_THAT(reply.initial, ElementsAre("a:1"));
    EXPECT_THAT(reply.trailing, ElementsAre("a:1"));
  }
}

TEST(NodeHeaderTest, StandaloneServerIgnoresNodeNames) {
  const OneCallServer server({});
  const Reply reply = server.Call({"a:1"});
  EXPECT_TRUE(reply.status.ok()) << reply.status;
  EXPECT_THAT(reply.initial, IsEmpty());
  EXPECT_THAT(reply.trailing, IsEmpty());
}

TEST(NodeHeaderTest, ACallForAnotherServerIsRefusedBeforeAnythingElse) {
  NobodyComesIn authenticator;
  const OneCallServer server({.authenticator = &authenticator, .node_name = "a:1"});
  const Reply reply = server.Call({"b:1"});
  EXPECT_TRUE(absl::IsUnavailable(reply.status)) << reply.status;
  EXPECT_TRUE(HasReason(reply.status, ErrorReason::kWrongNode)) << reply.status;
  EXPECT_THAT(reply.trailing, ElementsAre("a:1"));
  EXPECT_EQ(authenticator.asked, 0);
  EXPECT_EQ(server.served(), 0);
  EXPECT_TRUE(absl::IsUnauthenticated(server.Call({"a:1"}).status));
}

TEST(NodeHeaderTest, NoForgedNameComesThroughOrIsRepeated) {
  std::ostringstream log;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  {
    const OneCallServer server({.node_name = "a:1"});
    for (const std::vector<std::string>& nodes :
         {std::vector<std::string>{"forged"}, std::vector<std::string>{std::string(4'000, 'f')},
          std::vector<std::string>{""}, std::vector<std::string>{"a:1 forged"},
          std::vector<std::string>{"A:1"}, std::vector<std::string>{"a:1", "forged"},
          std::vector<std::string>{"forged", "a:1"}}) {
      const Reply reply = server.Call(nodes);
      EXPECT_TRUE(HasReason(reply.status, ErrorReason::kWrongNode)) << reply.status;
      EXPECT_THAT(std::string(reply.status.message()), Not(HasSubstr("forged")));
      EXPECT_THAT(ErrorInfoOf(reply.status).metadata, IsEmpty());
    }
    EXPECT_EQ(server.served(), 0);
  }
  spdlog::set_default_logger(before);
  EXPECT_THAT(log.str(), Not(HasSubstr("forged")));
  EXPECT_THAT(log.str(), Not(HasSubstr("ffff")));
}

}  // namespace
}  // namespace tissueform::testing
