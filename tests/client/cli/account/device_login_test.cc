// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/device_login.h"

#include <deque>
#include <ostream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using std::chrono::seconds;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

constexpr char kDiscovery[] = R"({"issuer": "https://a", "token_endpoint": "https://a/token",
    "device_authorization_endpoint": "https://a/device"})";
constexpr char kCode[] = R"({"device_code": "d", "user_code": "ABCD-EFGH", "interval": 2,
    "verification_uri": "https://a/go", "verification_uri_complete": "https://a/go?c=ABCD-EFGH",
    "expires_in": 60})";
constexpr char kTokens[] =
    R"({"access_token": "eyJ", "refresh_token": "r", "expires_in": 3600, "token_type": "Bearer"})";

HttpAnswer Error(const std::string& error) {
  return {.status = 400, .body = R"({"error": ")" + error + R"("})"};
}

// A provider that answers what the test has put there, in turn.
class DeviceLoginTest : public ::testing::Test {
 protected:
  absl::StatusOr<LoginTokens> Run() {
    return login_.Run([this](const DevicePrompt& prompt) { prompts_.push_back(prompt); });
  }

  absl::StatusOr<HttpAnswer> Answer(const LoginRequest& request) {
    requests_.push_back(request);
    if (answers_.empty()) return absl::UnavailableError("nobody answers");
    absl::StatusOr<HttpAnswer> answer = answers_.front();
    answers_.pop_front();
    return answer;
  }

  std::deque<absl::StatusOr<HttpAnswer>> answers_ = {HttpAnswer{.status = 200, .body = kDiscovery},
                                                     HttpAnswer{.status = 200, .body = kCode}};
  std::vector<LoginRequest> requests_;
  std::vector<DevicePrompt> prompts_;
  std::vector<seconds> waits_;
  DeviceLogin login_{{.issuer = "https://a", .client_id = "cli", .audience = "https://t"},
                     [this](const LoginRequest& request) { return Answer(request); },
                     [this](seconds time) { waits_.push_back(time); }};
};

TEST_F(DeviceLoginTest, PollsUntilTheUserHasLoggedIn) {
  answers_.insert(answers_.end(), {Error("authorization_pending"), Error("slow_down"),
                                   absl::UnavailableError("away for a moment"),
                                   HttpAnswer{.status = 200, .body = kTokens}});
  const auto tokens = Run();
  ASSERT_TRUE(tokens.ok()) << tokens.status();
  EXPECT_EQ(tokens->access_token, "eyJ");
  EXPECT_EQ(tokens->refresh_token, "r");
  EXPECT_EQ(tokens->lifetime, seconds(3600));
  EXPECT_THAT(waits_, ElementsAre(seconds(2), seconds(2), seconds(7), seconds(7)));
  ASSERT_EQ(prompts_.size(), 1U);
  EXPECT_EQ(prompts_[0].url, "https://a/go");
  EXPECT_EQ(prompts_[0].user_code, "ABCD-EFGH");
  EXPECT_EQ(prompts_[0].complete_url, "https://a/go?c=ABCD-EFGH");
  EXPECT_EQ(requests_[0].url, "https://a/.well-known/openid-configuration");
  EXPECT_THAT(requests_[1].form, Contains(Pair("resource", "https://t")));
  EXPECT_THAT(requests_[2].form, Contains(Pair("device_code", "d")));
}

TEST_F(DeviceLoginTest, GivesUpWhenTheCodeHasExpired) {
  answers_.push_back(Error("expired_token"));
  EXPECT_EQ(Run().status().code(), absl::StatusCode::kDeadlineExceeded);
}

TEST_F(DeviceLoginTest, DoesNotWaitForever) {
  for (int i = 0; i < 1000; ++i) answers_.push_back(Error("authorization_pending"));
  EXPECT_EQ(Run().status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(waits_.size(), 30U);  // a minute, every two seconds
}

TEST_F(DeviceLoginTest, RefusalByUserIsReported) {
  answers_.push_back(Error("access_denied"));
  const absl::Status status = Run().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(status.message()), HasSubstr("access_denied"));
}

TEST_F(DeviceLoginTest, RenewalKeepsTheRefreshTokenIfNoNewOneArrives) {
  answers_ = {HttpAnswer{.status = 200, .body = kDiscovery},
              HttpAnswer{.status = 200, .body = R"({"access_token": "new"})"}};
  const auto tokens = login_.Renew("old");
  ASSERT_TRUE(tokens.ok()) << tokens.status();
  EXPECT_EQ(tokens->access_token, "new");
  EXPECT_EQ(tokens->refresh_token, "old");
  EXPECT_EQ(tokens->lifetime, seconds(0));
  EXPECT_THAT(requests_[1].form, Contains(Pair("refresh_token", "old")));
}

TEST_F(DeviceLoginTest, ARefusedRenewalIsARefusal) {
  answers_ = {HttpAnswer{.status = 200, .body = kDiscovery}, Error("invalid_grant")};
  EXPECT_EQ(login_.Renew("old").status().code(), absl::StatusCode::kPermissionDenied);
}

TEST_F(DeviceLoginTest, IssuerMismatchNamesBothIssuers) {
  answers_ = {HttpAnswer{
      .status = 200, .body = R"({"issuer": "https://b/", "token_endpoint": "https://b/token"})"}};
  EXPECT_THAT(
      std::string(Run().status().message()),
      HasSubstr("issuer is https://b/, and --issuer says https://a; give --issuer https://b/"));
  answers_ = {HttpAnswer{.status = 200, .body = R"({"issuer": "https://a/{tenantid}/v2.0"})"}};
  EXPECT_THAT(std::string(Run().status().message()),
              HasSubstr("https://a/{tenantid}/v2.0, shared by all tenants"));
  answers_ = {HttpAnswer{.status = 200, .body = R"({"issuer": "https://\u001b[2J"})"}};
  EXPECT_THAT(std::string(Run().status().message()), HasSubstr("does not name an issuer"));
}

struct BadAnswer {
  const char* name;
  std::deque<absl::StatusOr<HttpAnswer>> answers;
  absl::StatusCode code;
};

void PrintTo(const BadAnswer& bad, std::ostream* out) { *out << bad.name; }

class BadAnswerTest : public DeviceLoginTest, public ::testing::WithParamInterface<BadAnswer> {};

TEST_P(BadAnswerTest, IsAnErrorOfOneLine) {
  answers_ = GetParam().answers;
  const absl::Status status = Run().status();
  EXPECT_EQ(status.code(), GetParam().code) << status;
  EXPECT_THAT(std::string(status.message()), ::testing::Not(HasSubstr("\n")));
  EXPECT_THAT(std::string(status.message()), ::testing::Not(HasSubstr("\x1b")));
}

HttpAnswer Good(const std::string& body) { return {.status = 200, .body = body}; }

std::vector<BadAnswer> BadAnswers() {
  return {
      BadAnswer{"NobodyThere", {}, absl::StatusCode::kUnavailable},
      BadAnswer{"NoJson", {Good("<html>")}, absl::StatusCode::kDataLoss},
      BadAnswer{"NoObject", {Good("[1]")}, absl::StatusCode::kDataLoss},
      BadAnswer{"DeepJson", {Good(std::string(200'000, '['))}, absl::StatusCode::kDataLoss},
      BadAnswer{
          "NotFound", {HttpAnswer{.status = 404, .body = kDiscovery}}, absl::StatusCode::kDataLoss},
      BadAnswer{"OtherIssuer",
                {Good(R"({"issuer": "https://b", "token_endpoint": "https://b/token"})")},
                absl::StatusCode::kDataLoss},
      BadAnswer{"PlainTokenEndpoint",
                {Good(R"({"issuer": "https://a", "token_endpoint": "http://a/token"})")},
                absl::StatusCode::kInvalidArgument},
      BadAnswer{"NoDeviceFlow",
                {Good(R"({"issuer": "https://a", "token_endpoint": "https://a/token"})")},
                absl::StatusCode::kFailedPrecondition},
      BadAnswer{"UnknownClient",
                {Good(kDiscovery), Error("invalid_client")},
                absl::StatusCode::kPermissionDenied},
      BadAnswer{"ErrorWithControlCharacters",
                {Good(kDiscovery), Error("\\u001b[2J\\n")},
                absl::StatusCode::kPermissionDenied},
      BadAnswer{"CodeWithControlCharacters",
                {Good(kDiscovery), Good(R"({"device_code": "d", "user_code": "\u001b[2J",
                  "verification_uri": "https://a/go"})")},
                absl::StatusCode::kDataLoss},
      BadAnswer{"NumbersForTexts",
                {Good(kDiscovery), Good(R"({"device_code": 1, "user_code": 2,
                  "verification_uri": "https://a/go"})")},
                absl::StatusCode::kDataLoss},
      BadAnswer{"UserSentElsewhere",
                {Good(kDiscovery), Good(R"({"device_code": "d", "user_code": "e",
                  "verification_uri": "javascript:x"})")},
                absl::StatusCode::kInvalidArgument},
      BadAnswer{
          "NoToken", {Good(kDiscovery), Good(kCode), Good("{}")}, absl::StatusCode::kDataLoss},
      BadAnswer{"TokenWithLines",
                {Good(kDiscovery), Good(kCode), Good(R"({"access_token": "a\nb"})")},
                absl::StatusCode::kDataLoss}};
}

INSTANTIATE_TEST_SUITE_P(Answers, BadAnswerTest, ::testing::ValuesIn(BadAnswers()),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace tissueform
