// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "client/cli/account/token_times.h"
#include "client/cli/account/token_work.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;
using Permissions = std::filesystem::perms;

using TokenCommandTest = CliTest;

TEST_F(TokenCommandTest, PrivateKeyIsOwnerOnlyAndNeverOverwritten) {
  EXPECT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  EXPECT_EQ(std::filesystem::status(Path("keys/private.pem")).permissions(),
            Permissions::owner_read | Permissions::owner_write);
  const std::string before = Read("keys/private.pem");
  EXPECT_THAT(Run({"token", "keygen", "--out", Path("keys")}),
              FailsWith(1, HasSubstr("keys/private.pem exists")));
  EXPECT_EQ(Read("keys/private.pem"), before);
}

TEST_F(TokenCommandTest, TokenHoldsRequestedClaimsAndIsUnique) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  const auto make = [&] {
    return Run({"token", "make", "--key", Path("keys/private.pem"), "--issuer", "i", "--audience",
                "a", "--audience", "b", "--subject", "alice", "--lifetime", "60", "--project",
                "jaws"});
  };
  const ProcessResult made = make();
  ASSERT_THAT(made, Succeeds());
  ASSERT_OK_AND_ASSIGN(
      const nlohmann::json shown,
      ShowToken(std::string(made.out, 0, made.out.size() - 1), std::chrono::system_clock::now()));
  const nlohmann::json& claims = shown["claims"];
  EXPECT_EQ(claims["sub"], "alice");
  EXPECT_EQ(claims["aud"], nlohmann::json({"a", "b"}));
  EXPECT_EQ(claims["tissueform_projects"], nlohmann::json::array({"jaws"}));
  EXPECT_EQ(claims["exp"].get<int64_t>() - claims["iat"].get<int64_t>(), 60);
  EXPECT_NE(make().out, made.out);
}

TEST_F(TokenCommandTest, ShowsTheClaimsOfAFileWithoutItsSignature) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  const ProcessResult made =
      Run({"token", "make", "--key", Path("keys/private.pem"), "--issuer", "i", "--audience", "a",
           "--subject", "alice", "--lifetime", "3600"});
  ASSERT_THAT(made, Succeeds());
  Write("token", made.out);
  const ProcessResult run = Run({"token", "show", Path("token")});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(run.err, "not verified\n");
  const nlohmann::json shown = nlohmann::json::parse(run.out);
  EXPECT_EQ(shown["header"]["alg"], "ES256");
  EXPECT_EQ(shown["claims"]["sub"], "alice");
  EXPECT_THAT(std::string(shown["state"]),
              MatchesRegex("in date: lasts [0-9]+ min by this machine's clock"));
  EXPECT_THAT(std::string(shown["times"]["exp"]), MatchesRegex("[0-9]+-.* UTC, in [0-9]+ min"));
  const std::string signature = made.out.substr(made.out.rfind('.') + 1, 20);
  EXPECT_THAT(run.out, Not(HasSubstr(signature)));
}

TEST_F(TokenCommandTest, AFileThatHoldsNoTokenIsNamed) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  for (const char* name : {"keys/private.pem", "keys/jwks.json"}) {
    EXPECT_THAT(Run({"token", "show", Path(name)}),
                FailsWith(1, AllOf(HasSubstr(name), HasSubstr("not a JSON Web Token"))));
  }
  EXPECT_THAT(Run({"token", "show", Path("keys/none")}),
              FailsWith(1, AllOf(HasSubstr("keys/none"), HasSubstr("cannot read"))));
  EXPECT_THAT(Run({"token", "show", Path("keys")}), FailsWith(1, HasSubstr("cannot read")));
}

TEST_F(TokenCommandTest, RefusesALifetimeAboveTheMaximum) {
  EXPECT_THAT(Run({"token", "make", "--key", "k", "--issuer", "i", "--audience", "a", "--subject",
                   "s", "--lifetime", "43201"}),
              FailsWith(2, HasSubstr("--lifetime")));
}

TEST_F(TokenCommandTest, PublicKeyCannotMakeAToken) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys"), "--rsa", "2048"}), Succeeds());
  for (const char* key : {"keys/public.pem", "keys/jwks.json", "keys/none"}) {
    EXPECT_THAT(Run({"token", "make", "--key", Path(key), "--issuer", "i", "--audience", "a",
                     "--subject", "s"}),
                FailsWith(1, AllOf(HasSubstr(key), HasSubstr("token keygen"))));
  }
}

TEST(ShowTokenTest, MalformedTokenIsReported) {
  for (const char* text : {"", "a", "a.b.c", "..", "e30.e30", "eyJhIjox.e30.", "\xff.\xff.\xff"}) {
    EXPECT_THAT(ShowToken(text, std::chrono::system_clock::now()),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a JSON Web Token")))
        << text;
  }
}

struct TimesCase {
  nlohmann::json claims;
  TokenDate date;
  const char* words;
};

TEST(TokenStateTest, SaysWhetherATokenIsInDate) {
  const std::chrono::system_clock::time_point now(std::chrono::seconds(1'000'000));
  for (const TimesCase& test : std::vector<TimesCase>{
           {{{"exp", 1'003'600}}, TokenDate::kInDate, "lasts 60 min"},
           {{{"exp", 1'000'000}}, TokenDate::kEnded, "ended 0 s ago"},
           {{{"exp", 1'000'000 - 86'400 * 3}}, TokenDate::kEnded, "ended 3 days ago"},
           {{{"exp", 1'000'600}, {"nbf", 1'000'300}},
            TokenDate::kNotYetValid,
            "becomes valid in 5 min"},
           {{{"exp", 1'000'600}, {"iat", 1'000'030}}, TokenDate::kInDate, "lasts 10 min"},
           {{{"exp", 1e300}}, TokenDate::kInDate, "lasts 11574074 days"},
           {{{"exp", "tomorrow"}}, TokenDate::kWithoutEnd, "without an expiry (exp)"},
           {nlohmann::json::object(), TokenDate::kWithoutEnd, "without an expiry (exp)"}}) {
    const TokenState state = TokenStateAt(test.claims, now);
    EXPECT_EQ(state.date, test.date) << test.claims;
    EXPECT_EQ(state.words, test.words) << test.claims;
  }
  EXPECT_EQ(TokenTimesAt({{"iat", 0}, {"exp", 1'000'090}, {"nbf", "x"}}, now),
            nlohmann::json({{"iat", "1970-01-01 00:00:00 UTC, 11 days ago"},
                            {"exp", "1970-01-12 13:48:10 UTC, in 90 s"}}));
}

}  // namespace
}  // namespace tissueform::testing
