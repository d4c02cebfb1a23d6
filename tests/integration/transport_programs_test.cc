// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "client/gateway/gateway.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"
#include "tests/testing/test_tokens.h"

// The server behind TLS with what stands before it, and with programs that are not ours.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

constexpr int kSomethingMissing = 77;
constexpr char kListMeshes[] = "/tissueform.v1.MeshService/ListMeshes";

class TransportProgramsTest : public ServiceTest {
 protected:
  ~TransportProgramsTest() override { std::filesystem::remove_all(folder_); }

  // With mTLS; with logins too where `tokens` says so.
  void Serve(const TokenOptions& tokens = {}) {
    ServerOptions options = TestOptions();
    options.tls.certificate = own_.certificate;
    options.tls.key = own_.key;
    options.tls.client_ca = own_.roots;
    options.tls.gateway_name = "gateway.example.org";
    options.tokens = tokens;
    StartServer(options);
  }

  // Exit code; `said_` is what it said.
  int Run(const std::string& command) {
    const std::string out = folder_ / "out.txt";
    const int status = std::system(absl::StrCat(command, " > ", out, " 2>&1").c_str());
    std::ifstream file(out);
    said_ = {std::istreambuf_iterator<char>(file), {}};
    return WEXITSTATUS(status);
  }

  void WriteToken(int64_t seconds) const {
    const std::filesystem::path next = folder_ / "next";
    WriteTestFile(next, EcKey().MakeToken(With(GoodClaims(), "exp", SecondsFromNow(seconds))));
    std::filesystem::permissions(
        next, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    std::filesystem::rename(next, folder_ / "token");
  }

  const std::filesystem::path folder_ = EmptyTestFolder("programs");
  const TestAuthority authority_;
  const TestFiles own_ = authority_.IssueFiles(folder_, "server");
  const TestFiles client_ = authority_.IssueFiles(folder_, "client", {.name = "client"});
  std::string said_;
};

TEST_F(TransportProgramsTest, OtherClientsConnectByMutualTls) {
  Serve();
  const int exit_code = Run(
      absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/tls_clients.py"), " ",
                   server().port(), " ", own_.roots, " ", client_.certificate, " ", client_.key));
  if (exit_code == kSomethingMissing) GTEST_SKIP() << said_;
  EXPECT_EQ(exit_code, 0) << said_;
  EXPECT_EQ(said_,
            "openssl tls1_1: refused\n"
            "openssl tls1_2: served, h2\n"
            "openssl tls1_3: served, h2\n"
            "python with certificate: OK\n"
            "python without certificate: UNAVAILABLE\n"
            "curl with certificate: application/grpc\n"
            "curl without certificate: refused\n"
            "curl in plain text: refused\n");
}

// What a user reads where no connection comes about; gRPC has lines of its own for each.
TEST_F(TransportProgramsTest, ACommandThatCannotConnectSaysOneLine) {
  const auto list = [&] {
    return absl::StrCat(ProgramPath("tissueform"),
                        " session list --server localhost:", server().port());
  };
  const std::string tls_to_plain = absl::StrCat(list(), " --tls-ca ", own_.roots);
  EXPECT_EQ(Run(tls_to_plain), 1);
  EXPECT_THAT(said_, MatchesRegex("tissueform: [^\n]+\n"));
  EXPECT_EQ(Run(absl::StrCat("GRPC_VERBOSITY=ERROR ", tls_to_plain)), 1);
  EXPECT_THAT(said_, HasSubstr("ssl_transport_security"));
  Serve();
  WriteTestFile(folder_ / "other.pem", TestAuthority("Another").certificate());
  EXPECT_EQ(Run(absl::StrCat(list(), " --tls-ca ", (folder_ / "other.pem").string())), 1);
  EXPECT_THAT(said_, MatchesRegex("tissueform: [^\n]+\n"));
}

TEST_F(TransportProgramsTest, GatewayCertificateDoesNotAuthenticateItsUsers) {
  const TokenFiles tokens;
  Serve(tokens.Options());
  const TestFiles gateway_files =
      authority_.IssueFiles(folder_, "gateway", {.alternatives = "DNS:gateway.example.org"});
  GatewayOptions options;
  options.server = absl::StrCat("localhost:", server().port());
  options.port = 0;
  options.upstream = {.certificate = gateway_files.certificate,
                      .key = gateway_files.key,
                      .authorities = gateway_files.roots};
  ASSERT_OK_AND_ASSIGN(const auto gateway, Gateway::Start(options));
  ASSERT_TRUE(Eventually([&] { return gateway->pool().IsReady(); }));
  WriteTestFile(folder_ / "empty", std::string(5, '\0'));
  const std::string call = absl::StrCat(
      "curl --silent --noproxy '*' --max-time 30 --include -H 'content-type: "
      "application/grpc-web+proto' -H 'x-tissueform-client-address: 198.51.100.7' --data-binary @",
      (folder_ / "empty").string(), " ", gateway->Url(), kListMeshes);
  ASSERT_EQ(Run(call), 0) << said_;
  EXPECT_THAT(said_, HasSubstr("grpc-status: 16")) << said_;
  const std::string token = EcKey().MakeToken(GoodClaims());
  ASSERT_EQ(Run(absl::StrCat(call, " -H 'authorization: Bearer ", token, "'")), 0) << said_;
  EXPECT_THAT(said_, Not(HasSubstr("grpc-status: 16")));
  EXPECT_THAT(said_, HasSubstr("grpc-status: 0"));
}

TEST_F(TransportProgramsTest, AGatewayJudgesTheServersCertificate) {
  Serve();
  const TestFiles strange = TestAuthority("Another").IssueFiles(folder_, "strange");
  GatewayOptions options;
  options.server = absl::StrCat("localhost:", server().port());
  options.port = 0;
  options.upstream = {
      .certificate = client_.certificate, .key = client_.key, .authorities = strange.roots};
  ASSERT_OK_AND_ASSIGN(const auto gateway, Gateway::Start(options));
  WriteTestFile(folder_ / "empty", std::string(5, '\0'));
  ASSERT_EQ(Run(absl::StrCat("curl --silent --noproxy '*' --max-time 30 --include -H "
                             "'content-type: application/grpc-web+proto' --data-binary @",
                             (folder_ / "empty").string(), " ", gateway->Url(), kListMeshes)),
            0);
  EXPECT_THAT(said_, HasSubstr("grpc-status: 14"));
  options.server = "192.0.2.1:50051";
  options.upstream = {};
  EXPECT_THAT(Gateway::Start(options),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("--server-ca")));
  options.trusted_proxies = {"a name"};
  options.insecure = true;
  EXPECT_THAT(Gateway::Start(options), StatusIs(kInvalid, HasSubstr("--trust-forwarded-from")));
}

TEST_F(TransportProgramsTest, ADragOutlivesItsFirstToken) {
  constexpr int64_t kFirstSeconds = 4;
  const TokenFiles tokens;
  TokenOptions logins = tokens.Options();
  logins.leeway = std::chrono::seconds(0);
  Serve(logins);
  WriteToken(kFirstSeconds);
  const auto first_ends = std::chrono::system_clock::now() + std::chrono::seconds(kFirstSeconds);
  ASSERT_OK_AND_ASSIGN(
      const auto client,
      TissueformClient::Connect(absl::StrCat("localhost:", server().port()),
                                {.connection = {.tls_ca = own_.roots,
                                                .tls_certificate = client_.certificate,
                                                .tls_key = client_.key,
                                                .token_file = folder_ / "token"}}));
  const v1::Session session = MakeSession(client.get(), BarProblem(3));
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  WriteToken(3600);
  // The token is renewed although nothing is dragged.
  EXPECT_TRUE(Eventually([&] {
    return std::chrono::system_clock::now() > first_ends + std::chrono::milliseconds(500);
  }));
  EXPECT_THAT(stream->SendPoses(1, TopPose(SomePose(1))), IsOk());
  EXPECT_TRUE(stream->Receive().has_value());
  stream->CloseSending();
  EXPECT_THAT(stream->Finish(), IsOk());
  EXPECT_THAT(client->GetSession(session.name()), IsOk());
}

TEST_F(TransportProgramsTest, DragThroughHaproxyContinuesDuringAFlood) {
  const int exit_code =
      Run(absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/flood_haproxy.py"),
                       " ", ProgramPath("tissueform"), " ", ProgramPath("tissueform-server"), " ",
                       SourcePath("deploy/haproxy/grpc.cfg"), " 2"));
  if (exit_code == kSomethingMissing) GTEST_SKIP() << said_;
  EXPECT_EQ(exit_code, 0) << said_;
  EXPECT_THAT(said_, AllOf(HasSubstr("beside the connections: 1100 held, 0 turned away"),
                           HasSubstr("beside those of one address: 200 held, 900 turned away")));
}

}  // namespace
}  // namespace tissueform::testing
