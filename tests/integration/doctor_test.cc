// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "client/cli/doctor/doctor_command.h"
#include "client/cli/session/server_process.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"
#include "tests/testing/test_tokens.h"

// `tissueform doctor` against a good server and broken ones: which line says it, and what to do.
namespace tissueform::testing {
namespace {

using std::chrono::hours;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class DoctorTest : public ServiceTest {
 protected:
  ~DoctorTest() override { std::filesystem::remove_all(folder_); }

  ServerOptions TlsServer(const TestFiles& files) const {
    ServerOptions options = TestOptions();
    options.tls.certificate = files.certificate;
    options.tls.key = files.key;
    return options;
  }

  std::string name() { return absl::StrCat("localhost:", server().port()); }

  // Of a token with these claims.
  std::string WriteToken(const nlohmann::json& claims) const {
    const std::filesystem::path path = folder_ / "token";
    WriteTestFile(path, EcKey().MakeToken(claims));
    std::filesystem::permissions(
        path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    return path;
  }

  const std::filesystem::path folder_ = EmptyTestFolder("doctor");
  const TestAuthority authority_;
  const TestFiles own_ = authority_.IssueFiles(folder_, "server");
};

std::vector<std::string> ChecksOf(const DoctorReport& report) {
  std::vector<std::string> checks;
  for (const DoctorLine& line : report.lines()) checks.push_back(line.check);
  return checks;
}

// That it ends with this check, which has failed, and says and advises so.
void ExpectEndsWith(const DoctorReport& report, const std::string& check, const std::string& text,
                    const std::string& advice) {
  ASSERT_FALSE(report.lines().empty());
  const DoctorLine& line = report.lines().back();
  EXPECT_EQ(line.finding, Finding::kFailed) << report.Text();
  EXPECT_EQ(line.check, check) << report.Text();
  EXPECT_THAT(line.text, HasSubstr(text));
  EXPECT_THAT(line.advice, HasSubstr(advice));
}

TEST_F(DoctorTest, AGoodServerInPlainText) {
  const DoctorReport report = AskDoctor({.address = name()});
  EXPECT_FALSE(report.failed()) << report.Text();
  EXPECT_EQ(ChecksOf(report).front(), "name");
  EXPECT_EQ(ChecksOf(report).back(), "work");
  EXPECT_THAT(report.Text(), HasSubstr("dragged and deleted"));
  // Nothing of it stays.
  ASSERT_OK_AND_ASSIGN(const auto sessions, Connect()->ListSessions());
  ASSERT_OK_AND_ASSIGN(const auto meshes, Connect()->ListMeshes());
  EXPECT_TRUE(sessions.empty());
  EXPECT_TRUE(meshes.empty());
}

TEST_F(DoctorTest, AGoodServerWithTlsAndLogins) {
  const TokenFiles tokens;
  ServerOptions options = TlsServer(own_);
  options.tls.client_ca = own_.roots;
  options.tokens = tokens.Options();
  StartServer(options);
  const TestFiles client = authority_.IssueFiles(folder_, "client");
  const DoctorReport report = AskDoctor(
      {.address = name(),
       .options = {.tls_ca = client.roots,
                   .tls_certificate = client.certificate,
                   .tls_key = client.key,
                   .token_file = WriteToken(With(GoodClaims(), "exp", SecondsFromNow(3660)))}});
  EXPECT_FALSE(report.failed()) << report.Text();
  EXPECT_THAT(report.Text(),
              AllOf(HasSubstr("TLSv1.3, certificate of localhost"), HasSubstr("days left"),
                    HasSubstr("issued by CN=Test authority; ALPN selected h2"),
                    HasSubstr("of alice, from "), HasSubstr("lasts 60 min"),
                    HasSubstr("you are logged in as alice"), HasSubstr("clock"),
                    HasSubstr("dragged and deleted")));
}

TEST_F(DoctorTest, UnknownHostName) {
  ExpectEndsWith(AskDoctor({.address = "no-such-host.invalid:50051"}), "name",
                 "no-such-host.invalid", "DNS");
}

TEST_F(DoctorTest, AClosedPort) {
  const std::string address = name();
  server().Drain();
  ExpectEndsWith(AskDoctor({.address = address}), "route", "refused", "is the server started");
}

TEST_F(DoctorTest, PlainTextToATlsPort) {
  StartServer(TlsServer(own_));
  ExpectEndsWith(AskDoctor({.address = name()}), "encryption", "speaks TLS", "--tls-ca");
}

TEST_F(DoctorTest, TlsToAPlainPort) {
  ExpectEndsWith(AskDoctor({.address = name(), .options = {.tls_ca = own_.roots}}), "encryption",
                 "does not speak TLS", "omit --tls");
}

TEST_F(DoctorTest, AnUnknownAuthority) {
  StartServer(TlsServer(own_));
  WriteTestFile(folder_ / "other.pem", TestAuthority("Another").certificate());
  ExpectEndsWith(AskDoctor({.address = name(), .options = {.tls_ca = folder_ / "other.pem"}}),
                 "encryption", "certificate, issued by CN=Test authority: ", "--tls-ca FILE");
}

TEST_F(DoctorTest, AnotherName) {
  StartServer(TlsServer(authority_.IssueFiles(
      folder_, "named", {.alternatives = "DNS:planner.example.org,DNS:planner"})));
  ExpectEndsWith(AskDoctor({.address = name(), .options = {.tls_ca = own_.roots}}), "encryption",
                 "planner.example.org, planner and not for localhost", "connect using a name");
}

TEST_F(DoctorTest, AnExpiredCertificate) {
  // Our server would not start with one.
  const TestIdentity old = authority_.Issue({.begins = hours(-96), .ends = hours(-47)});
  grpc::SslServerCredentialsOptions tls;
  tls.pem_key_cert_pairs.push_back({old.key, old.certificate});
  grpc::ServerBuilder builder;
  v1::ServerInfoService::Service service;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::SslServerCredentials(tls), &port);
  builder.RegisterService(&service);
  const std::unique_ptr<grpc::Server> running = builder.BuildAndStart();
  ExpectEndsWith(
      AskDoctor({.address = absl::StrCat("127.0.0.1:", port), .options = {.tls_ca = own_.roots}}),
      "encryption", "expired, 1 days ago", "renew");
}

TEST_F(DoctorTest, NoCertificateWhereOneIsAskedFor) {
  ServerOptions options = TlsServer(own_);
  options.tls.client_ca = own_.roots;
  StartServer(options);
  ExpectEndsWith(AskDoctor({.address = name(), .options = {.tls_ca = own_.roots}}), "encryption",
                 "no handshake", "--tls-cert");
}

TEST_F(DoctorTest, ATokenThatHasEndedByTheClockHereIsForTheServerToJudge) {
  const DoctorReport report = AskDoctor(
      {.address = name(),
       .options = {.token_file = WriteToken(With(GoodClaims(), "exp", SecondsFromNow(-7200)))}});
  // This server does not require authentication.
  EXPECT_FALSE(report.failed()) << report.Text();
  EXPECT_THAT(report.Text(),
              AllOf(HasSubstr("ended 2 h ago by this machine's clock"), HasSubstr("log in again")));
}

// A token that a server does not take, and what the doctor says of it.
struct RefusedToken {
  const char* name;
  const char* claim;
  std::function<nlohmann::json()> value;  // made in the test, whose clock has gone on
  std::vector<const char*> found;
  const char* advice;
};

void PrintTo(const RefusedToken& token, std::ostream* out) { *out << token.name; }

std::vector<RefusedToken> RefusedTokens() {
  return {{"Expired",
           "exp",
           [] { return SecondsFromNow(-7200); },
           {"expired 2h", "server's clock"},
           "log in again"},
          {"NotYetValid",
           "nbf",
           [] { return SecondsFromNow(300); },
           {"becomes valid in "},
           "logging in again does not help"},
          {"Issuer",
           "iss",
           [] { return "https://sts.example/1/"; },
           {"\"https://sts.example/1/\"", "\"https://login.example\""},
           "--token-issuer"},
          {"Audience",
           "aud",
           [] { return "another"; },
           {"\"another\"", "\"tissueform\""},
           "the same login again does not help"}};
}

class DoctorRefusedTokenTest : public DoctorTest,
                               public ::testing::WithParamInterface<RefusedToken> {};

TEST_P(DoctorRefusedTokenTest, ReportsFoundAndExpectedValuesWithAdvice) {
  const TokenFiles tokens;
  ServerOptions options = TestOptions();
  options.tokens = tokens.Options();
  StartServer(options);
  const RefusedToken& bad = GetParam();
  const DoctorReport report = AskDoctor(
      {.address = name(),
       .options = {.token_file = WriteToken(With(GoodClaims(), bad.claim, bad.value()))}});
  for (const char* found : bad.found) ExpectEndsWith(report, "login", found, bad.advice);
  EXPECT_THAT(report.Text(), Not(HasSubstr("eyJ")));
}

INSTANTIATE_TEST_SUITE_P(Tokens, DoctorRefusedTokenTest, ::testing::ValuesIn(RefusedTokens()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(DoctorTest, NoTokenWhereOneIsAskedFor) {
  const TokenFiles tokens;
  ServerOptions options = TestOptions();
  options.tokens = tokens.Options();
  StartServer(options);
  ExpectEndsWith(AskDoctor({.address = name()}), "login", "no token", "tissueform login");
}

TEST_F(DoctorTest, ATokenOfAnotherProviderNamesTheServersOwn) {
  const TokenFiles tokens;
  ServerOptions options = TestOptions();
  options.tokens = tokens.Options();
  StartServer(options);
  const std::filesystem::path path = WriteToken(GoodClaims());
  WriteTestFile(path, OtherEcKey().MakeToken(With(GoodClaims(), "iss", "https://other.example")));
  const DoctorReport report = AskDoctor({.address = name(), .options = {.token_file = path}});
  ExpectEndsWith(report, "login", "does not belong to \"https://login.example\"", "--token-issuer");
  // By the token's own words, read here.
  EXPECT_THAT(report.Text(), HasSubstr("from https://other.example for"));
}

// A proxy that ends TLS and knows no HTTP/2; what it selects, and how it refuses the rest.
struct OldProxy {
  const char* name;
  std::vector<std::string> words;  // of serve_tls.py: how, and what ALPN may select
  const char* found;
};

void PrintTo(const OldProxy& proxy, std::ostream* out) { *out << proxy.name; }

class DoctorOldProxyTest : public DoctorTest, public ::testing::WithParamInterface<OldProxy> {};

TEST_P(DoctorOldProxyTest, ReportsTheProtocolThatAlpnSelects) {
  std::vector<std::string> words = {SourcePath("tests/integration/serve_tls.py"),
                                    GetParam().words.front(), own_.certificate, own_.key};
  words.insert(words.end(), GetParam().words.begin() + 1, GetParam().words.end());
  ASSERT_OK_AND_ASSIGN(const auto proxy,
                       ServerProcess::Start(TISSUEFORM_PYTHON, words, std::chrono::seconds(60)));
  const std::string port = proxy->address().substr(proxy->address().rfind(':'));
  const DoctorReport report =
      AskDoctor({.address = absl::StrCat("localhost", port), .options = {.tls_ca = own_.roots}});
  ExpectEndsWith(report, "encryption", GetParam().found, "offer h2 by ALPN");
  // A client without TLS options gets a hint.
  ExpectEndsWith(AskDoctor({.address = absl::StrCat("localhost", port)}), "encryption",
                 "speaks TLS", "--tls-ca");
}

INSTANTIATE_TEST_SUITE_P(
    Proxies, DoctorOldProxyTest,
    ::testing::Values(OldProxy{"WithoutAlpn", {"passing"}, "does not select a protocol"},
                      OldProxy{"OfHttp1", {"passing", "http/1.1"}, "selects http/1.1"},
                      OldProxy{"OfHttp1Strictly", {"refusing", "http/1.1"}, "selects http/1.1"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(DoctorTest, AFullServer) {
  ServerOptions options = TestOptions();
  options.memory_budget_bytes = 1;
  StartServer(options);
  ExpectEndsWith(AskDoctor({.address = name()}), "work", "RESOURCE_EXHAUSTED", "full");
}

TEST_F(DoctorTest, InvalidAddress) {
  for (const char* address : {"", "planner", "planner:", "planner:0", "planner:65536", "::1:80"}) {
    ExpectEndsWith(AskDoctor({.address = address}), "name", "HOST:PORT", "");
  }
}

TEST_F(DoctorTest, JsonSaysTheSame) {
  const DoctorReport report = AskDoctor({.address = "no-such-host.invalid:1"});
  const nlohmann::ordered_json json = report.Json("no-such-host.invalid:1");
  EXPECT_EQ(json["healthy"], false);
  ASSERT_EQ(json["checks"].size(), 1);
  EXPECT_EQ(json["checks"][0]["check"], "name");
  EXPECT_EQ(json["checks"][0]["finding"], "failed");
}

}  // namespace
}  // namespace tissueform::testing
