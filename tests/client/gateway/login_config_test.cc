// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/login_config.h"

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "tests/client/gateway/gateway_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

TEST(LoginConfig, IssuersAreHttpsOrOnLoopback) {
  for (const char* issuer :
       {"https://login.example.org", "https://login.example.org:8443/realms/clinic",
        "http://localhost:9000", "http://127.0.0.1:9000/oidc"}) {
    EXPECT_TRUE(CheckLoginConfig({.issuer = issuer, .client_id = "planner"}).ok()) << issuer;
  }
  for (const char* issuer :
       {"http://login.example.org", "login.example.org", "https://", "https://a b", "ftp://a",
        "https://a:port", "https://a:0", "https://a:65536", "https://user@a", "https://a?x=1",
        "https://a#x", "https://a; script-src *", "https://a/\r\nx: y", "https://*",
        "http://localhost.example.org", "https://[::1"}) {
    EXPECT_EQ(CheckLoginConfig({.issuer = issuer, .client_id = "planner"}).code(),
              absl::StatusCode::kInvalidArgument)
        << issuer;
  }
}

TEST(LoginConfig, AnIssuerForEveryTenantIsRefusedByItsName) {
  EXPECT_THAT(
      CheckLoginConfig({.issuer = "https://login.example.org/{tenantid}/v2.0", .client_id = "a"}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("replace it with your tenant's id")));
}

TEST(LoginConfig, IssuerAndClientIdBelongTogether) {
  EXPECT_TRUE(CheckLoginConfig({}).ok());
  EXPECT_FALSE(CheckLoginConfig({.issuer = "https://a"}).ok());
  EXPECT_FALSE(CheckLoginConfig({.client_id = "planner"}).ok());
}

TEST(LoginConfig, OriginEndsWhereThePathBegins) {
  EXPECT_EQ(OriginOfIssuer({.issuer = "https://a.org:8443/realms/b"}), "https://a.org:8443");
  EXPECT_EQ(OriginOfIssuer({}), "");
}

class LoginGatewayTest : public GatewayTest {
 protected:
  std::string Get(const std::string& path, const LoginConfig& login) {
    Restart({}, login);
    return Ask(port(), absl::StrCat("GET ", path, " HTTP/1.1"));
  }

  const LoginConfig clinic_ = {.issuer = "https://login.example.org/realms/clinic",
                               .client_id = "planner",
                               .audience = "tissueform"};
};

TEST_F(LoginGatewayTest, WithoutAProviderTheConfigIsEmpty) {
  const std::string reply = Get("/config.json", {});
  EXPECT_EQ(StatusOf(reply), 200);
  EXPECT_THAT(reply, HasSubstr("\r\n\r\n{}\n"));
  EXPECT_THAT(reply, HasSubstr("connect-src 'self';"));
}

TEST_F(LoginGatewayTest, PageReceivesTheProviderAndMayConnectToNoOther) {
  const std::string reply = Get("/config.json", clinic_);
  EXPECT_THAT(reply, HasSubstr("content-type: application/json\r\n"));
  EXPECT_THAT(reply, HasSubstr("cache-control: no-store\r\n"));
  EXPECT_THAT(reply, HasSubstr("connect-src 'self' https://login.example.org; worker-src"));
  const auto oidc = nlohmann::json::parse(reply.substr(reply.find("\r\n\r\n")))["oidc"];
  EXPECT_EQ(oidc["issuer"], clinic_.issuer);
  EXPECT_EQ(oidc["client_id"], "planner");
  EXPECT_EQ(oidc["audience"], "tissueform");
  EXPECT_EQ(oidc["scope"], "openid profile");
}

TEST_F(LoginGatewayTest, PageReceivesAClinicsDeviationsWithNothingLeftOut) {
  const std::string file = ::testing::TempDir() + "/gateway_deviations.json";
  const auto write = [&file](const std::string& text) { std::ofstream(file) << text; };
  write(R"({"source": "ours", "model_mm": {"chin": 0.5}, "operations": {"bsso": {}}})");
  Restart({}, {}, file);
  const std::string reply = Ask(port(), "GET /config.json HTTP/1.1");
  const auto json = nlohmann::json::parse(reply.substr(reply.find("\r\n\r\n")))["deviations"];
  EXPECT_EQ(json["source"], "ours");
  EXPECT_EQ(
      json["model_mm"],
      nlohmann::json({{"default", 0.89}, {"chin", 0.5}, {"lower_lip", 1.5}, {"upper_lip", 1.5}}));
  EXPECT_EQ(json["surgery"]["translation_mm"], nlohmann::json({0.82, 1.1, 1.27}));
  EXPECT_EQ(json["operations"]["bsso"]["model_mm"], json["model_mm"]);

  write(R"({"model_mm": {"chn": 1}})");
  GatewayOptions options;
  options.server = server_.address();
  options.port = 0;
  options.deviations = file;
  EXPECT_THAT(Gateway::Start(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("unknown place \"chn\"")));
  std::filesystem::remove(file);
}

TEST_F(LoginGatewayTest, TheConfigurationIsReadOnly) {
  Restart({}, clinic_);
  EXPECT_EQ(StatusOf(Ask(port(), "POST /config.json HTTP/1.1")), 405);
}

TEST_F(LoginGatewayTest, AGatewayWithAWrongProviderDoesNotStart) {
  GatewayOptions options;
  options.server = server_.address();
  options.port = 0;
  options.login = {.issuer = "http://login.example.org", .client_id = "planner"};
  EXPECT_THAT(std::string(Gateway::Start(options).status().message()), HasSubstr("--oidc-issuer"));
}

}  // namespace
}  // namespace tissueform::testing
