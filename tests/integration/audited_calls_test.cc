// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/client_context.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/base/error_reason.h"
#include "tests/integration/service_test.h"
#include "tests/testing/journal_socket.h"
#include "tests/testing/status_matchers.h"
#include "tissueform/v1/session_service.grpc.pb.h"

// What the journal receives of a server's calls, and what the server refuses without one.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

class AuditedCallsTest : public ServiceTest {
 protected:
  void SetUp() override {
    journal_.emplace(socket_);
    ServerOptions options = TestOptions();
    options.telemetry.audit = {.target = "journal", .journal_socket = socket_};
    StartServer(options);
  }

  grpc::Status List(const std::string& request_id) {
    const auto stub = v1::SessionService::NewStub(OwnChannel());
    grpc::ClientContext context;
    context.AddMetadata("x-request-id", request_id);
    v1::ListSessionsResponse response;
    return stub->ListSessions(&context, {}, &response);
  }

  // How often each request's call came.
  std::map<std::string, int> Calls() {
    for (const std::string& message : journal_->Messages()) {
      const auto event = nlohmann::json::parse(message);
      if (event.at("event") == "call") ++calls_[event.at("request_id")];
    }
    return calls_;
  }

  const std::string socket_ = NewSocketPath();
  std::optional<JournalSocket> journal_;
  std::map<std::string, int> calls_;
};

TEST_F(AuditedCallsTest, EveryCallArrivesOnce) {
  constexpr int kCalls = 200;
  for (int i = 0; i < kCalls; ++i) {
    EXPECT_TRUE(List(absl::StrCat("request-", i)).ok());
    // The socket holds some 150 entries; when it is full for a second calls are refused.
    if (i % 50 == 0) Calls();
  }
  ASSERT_TRUE(Eventually([this] { return Calls().size() == kCalls; }));
  for (const auto& [request, count] : Calls()) EXPECT_EQ(count, 1) << request;
}

TEST_F(AuditedCallsTest, WithoutAJournalCallsAreRefusedUntilOneIsThere) {
  EXPECT_TRUE(List("before").ok());
  ASSERT_TRUE(Eventually([this] { return Calls().size() == 1; }));
  journal_.reset();
  EXPECT_TRUE(List("unknown").ok()) << "the last one that nobody could know of";
  grpc::Status refused;
  ASSERT_TRUE(Eventually([&] { return !(refused = List("refused")).ok(); }));
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_THAT(refused.error_message(), HasSubstr("the audit log cannot be written"));
  EXPECT_THAT(refused.error_details(), HasSubstr("AUDIT_NOT_WRITTEN"));
  EXPECT_THAT(Connect()->GetServerInfo(), IsOk()) << "touches no content";
  journal_.emplace(socket_);
  ASSERT_TRUE(Eventually([this] {
    const bool is_served = List("after").ok();
    return Calls().contains("after") && is_served;
  }));
  EXPECT_EQ(Calls().at("unknown"), 1) << "what waited is not lost";
}

TEST_F(AuditedCallsTest, WithoutAJournalTheServerDoesNotStart) {
  ServerOptions options = TestOptions();
  options.telemetry.audit = {.target = "journal", .journal_socket = socket_ + "-none"};
  EXPECT_THAT(TissueformServer::Start(options),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("start systemd-journald")));
}

TEST_F(AuditedCallsTest, ACollectorOfAServerInMemoryNeedsAFolder) {
  ServerOptions options = TestOptions();
  options.telemetry.audit = {.target = "syslog://localhost"};
  EXPECT_THAT(TissueformServer::Start(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--audit-buffer")));
}

}  // namespace
}  // namespace tissueform::testing
