// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_options.h"

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

TokenOptions Parsed(std::vector<std::string> words) {
  CLI::App app;
  TokenOptions options;
  AddTokenOptions(app, &options);
  app.parse(std::move(words));
  return options;
}

TEST(TokenOptionsTest, NothingIsConfiguredUnlessSomethingIsGiven) {
  EXPECT_FALSE(Parsed({}).configured());
  EXPECT_TRUE(Parsed({"--token-issuer=a"}).configured());
  EXPECT_TRUE(Parsed({"--token-revocations=a"}).configured());
}

TEST(TokenOptionsTest, AudiencesMayBeSeveral) {
  EXPECT_EQ(Parsed({"--token-audience=b", "--token-audience=a"}).audiences.size(), 2U);
}

TEST(TokenOptionsTest, AnIssuerForEveryTenantIsRefused) {
  TokenOptions options{.issuer = "https://login.example/{tenantid}/v2.0", .audiences = {"a"}};
  options.keys_file = "keys.pem";
  EXPECT_THAT(CheckTokenOptions(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("--token-issuer https://login.example/{tenantid}/v2.0 has a "
                                 "placeholder")));
}

TEST(TokenOptionsTest, ErrorNamesTheMissingOption) {
  EXPECT_THAT(CheckTokenOptions({}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--token-issuer")));
  TokenOptions options{.issuer = "a"};
  EXPECT_THAT(CheckTokenOptions(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--token-audience")));
  options.audiences = {"a"};
  EXPECT_THAT(CheckTokenOptions(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--token-jwks-url")));
  options.jwks_url = "http://login.example/keys";
  EXPECT_THAT(CheckTokenOptions(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("must use https")));
  options.jwks_url = "https://login.example/keys";
  EXPECT_THAT(CheckTokenOptions(options), IsOk());
  options.keys_file = "keys.pem";
  EXPECT_THAT(CheckTokenOptions(options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("give one of")));
}

}  // namespace
}  // namespace tissueform::testing
