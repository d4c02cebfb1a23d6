// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cli/session/server_process.h"
#include "core/base/error_reason.h"
#include "server/access/auth/token_authenticator.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"
#include "tests/testing/test_tokens.h"

// Keys from a web server of another project.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kWebPatience{60};

class TokenKeysUrlTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
    Publish(EcKey().PublicJwks().dump());
    auto web = ServerProcess::Start(
        TISSUEFORM_PYTHON, {SourcePath("tests/integration/serve_keys.py"), folder_.string()},
        kWebPatience);
    ASSERT_THAT(web, IsOk());
    web_ = *std::move(web);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Publish(const std::string& keys) const { Replace(folder_ / "jwks.json", keys); }

  TokenOptions Options(const std::string& path = "/jwks.json") const {
    TokenOptions options{.issuer = kIssuer, .audiences = {kAudience}};
    options.jwks_url = absl::StrCat("http://", web_->address(), path);
    options.jwks_times.least = std::chrono::milliseconds(20);
    options.jwks_times.retry = std::chrono::milliseconds(20);
    return options;
  }

  std::filesystem::path folder_;
  std::unique_ptr<ServerProcess> web_;
};

absl::Status AskWith(Authenticator* authenticator, const std::string& token) {
  const std::string bearer = absl::StrCat("Bearer ", token);
  return authenticator->Authenticate({.authorization = {bearer}}).status();
}

// 10,000 calls or so, in which keys come, go and become nonsense.
TEST_F(TokenKeysUrlTest, NoGoodCallFailsWhileTheProvidersKeysRotateAndAreNonsense) {
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(Options()));
  const std::string old_token = EcKey().MakeToken(GoodClaims());
  const std::string new_token = OtherEcKey().MakeToken(GoodClaims());
  std::atomic<bool> done = false;
  std::atomic<int64_t> calls = 0;
  std::atomic<int64_t> failed = 0;
  std::thread caller([&] {
    for (; !done; ++calls) {
      if (!AskWith(authenticator.get(), old_token).ok()) ++failed;
    }
  });
  // Refused at first; asking for it makes the server look.
  EXPECT_TRUE(absl::IsUnauthenticated(AskWith(authenticator.get(), new_token)));
  Publish("<html>we are rebuilding our login</html>");
  EXPECT_TRUE(Eventually([&] {
    AskWith(authenticator.get(), new_token).IgnoreError();
    return authenticator->standing().keys_alarm;
  }));
  EXPECT_EQ(authenticator->standing().keys, 1);
  Publish(JwksOf(EcKey(), OtherEcKey()));
  EXPECT_TRUE(Eventually([&] { return AskWith(authenticator.get(), new_token).ok(); }));
  EXPECT_FALSE(authenticator->standing().keys_alarm);
  EXPECT_TRUE(Eventually([&] { return calls > 10'000; }));
  done = true;
  caller.join();
  EXPECT_EQ(failed, 0);
  EXPECT_GE(authenticator->standing().alarms, 1);
  // The old key goes: its tokens are forgotten with it.
  Publish(OtherEcKey().PublicJwks().dump());
  EXPECT_TRUE(Eventually([&] {
    AskWith(authenticator.get(), RsaKey().MakeToken(GoodClaims())).IgnoreError();
    return !AskWith(authenticator.get(), old_token).ok();
  }));
  EXPECT_THAT(AskWith(authenticator.get(), new_token), IsOk());
}

TEST_F(TokenKeysUrlTest, AProviderThatIsNotThereYetIsAskedAgain) {
  std::filesystem::remove(folder_ / "jwks.json");
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(Options()));
  EXPECT_TRUE(authenticator->standing().keys_alarm);
  const std::string token = EcKey().MakeToken(GoodClaims());
  EXPECT_TRUE(absl::IsUnauthenticated(AskWith(authenticator.get(), token)));
  Publish(EcKey().PublicJwks().dump());
  EXPECT_TRUE(Eventually([&] { return AskWith(authenticator.get(), token).ok(); }));
}

TEST_F(TokenKeysUrlTest, ItIsAskedRarelyHoweverManyUnknownKeysCome) {
  TokenOptions options = Options();
  options.jwks_times.least = std::chrono::hours(1);
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(options));
  Publish(OtherEcKey().PublicJwks().dump());
  const std::string token = OtherEcKey().MakeToken(GoodClaims());
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(absl::IsUnauthenticated(AskWith(authenticator.get(), token)));
  }
  EXPECT_EQ(authenticator->failures().count(TokenFailure::kUnknownKey), 1000);
}

TEST_F(TokenKeysUrlTest, FollowsNoRedirectAndReadsNoEndlessBody) {
  const std::atomic<bool> stopping = false;
  EXPECT_THAT(DownloadJwks(Options("/elsewhere").jwks_url, stopping),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("HTTP status 302")));
  EXPECT_THAT(DownloadJwks(Options("/without_end").jwks_url, stopping),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("more than 1 MiB")));
  EXPECT_THAT(DownloadJwks(Options("/nothing_here").jwks_url, stopping),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("HTTP status 404")));
  EXPECT_THAT(DownloadJwks(Options("/jwks.json").jwks_url, stopping), IsOk());
  const std::atomic<bool> stopped = true;
  EXPECT_THAT(DownloadJwks(Options("/silent").jwks_url, stopped),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
}

TEST_F(TokenKeysUrlTest, NonsenseAtTheStartIsRefused) {
  Publish("nonsense");
  EXPECT_THAT(TokenAuthenticator::Start(Options()).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--token-jwks-url: ")));
}

struct BadUrl {
  const char* name;
  const char* url;
  const char* error;
};

class BadUrlTest : public ::testing::TestWithParam<BadUrl> {};

TEST_P(BadUrlTest, IsRefusedWithoutARequest) {
  EXPECT_THAT(CheckJwksUrl(GetParam().url),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam().error)));
}

INSTANTIATE_TEST_SUITE_P(
    Urls, BadUrlTest,
    ::testing::Values(BadUrl{"PlainHttp", "http://login.example/keys", "must use https"},
                      BadUrl{"LooksLikeLoopback", "http://127.0.0.1.example/k", "must use https"},
                      BadUrl{"HidesItsHost", "http://localhost@evil.example/k", "password"},
                      BadUrl{"File", "file:///etc/passwd", "must use https"},
                      BadUrl{"Ftp", "ftp://login.example/keys", "must use https"},
                      BadUrl{"WithPassword", "https://a:b@login.example/keys", "password"},
                      BadUrl{"NoUrl", "keys.json", "not a URL"}, BadUrl{"Empty", "", "not a URL"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(JwksUrlTest, HttpsAndLoopbackAreTaken) {
  for (const char* url : {"https://login.example/keys", "http://127.0.0.1:8080/k",
                          "http://localhost/k", "http://[::1]:1/k"}) {
    EXPECT_THAT(CheckJwksUrl(url), IsOk()) << url;
  }
}

}  // namespace
}  // namespace tissueform::testing
