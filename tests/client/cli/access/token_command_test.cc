// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "client/cli/access/token_work.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Permissions = std::filesystem::perms;

using TokenCommandTest = CliTest;

TEST_F(TokenCommandTest, OnlyItsOwnerReadsAPrivateKeyAndNothingIsWrittenOver) {
  EXPECT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  EXPECT_EQ(std::filesystem::status(Path("keys/private.pem")).permissions(),
            Permissions::owner_read | Permissions::owner_write);
  const std::string before = Read("keys/private.pem");
  EXPECT_THAT(Run({"token", "keygen", "--out", Path("keys")}),
              FailsWith(1, HasSubstr("private.pem")));
  EXPECT_EQ(Read("keys/private.pem"), before);
}

TEST_F(TokenCommandTest, ATokenSaysWhatItWasToldAndHasANameOfItsOwn) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys")}), Succeeds());
  const auto make = [&] {
    return Run({"token", "make", "--key", Path("keys/private.pem"), "--issuer", "i", "--audience",
                "a", "--audience", "b", "--subject", "alice", "--lifetime", "60", "--project",
                "jaws"});
  };
  const ProcessResult made = make();
  ASSERT_THAT(made, Succeeds());
  ASSERT_OK_AND_ASSIGN(const nlohmann::json shown,
                       ShowToken(std::string(made.out, 0, made.out.size() - 1)));
  const nlohmann::json& claims = shown["claims"];
  EXPECT_EQ(claims["sub"], "alice");
  EXPECT_EQ(claims["aud"], nlohmann::json({"a", "b"}));
  EXPECT_EQ(claims["tissueform_projects"], nlohmann::json::array({"jaws"}));
  EXPECT_EQ(claims["exp"].get<int64_t>() - claims["iat"].get<int64_t>(), 60);
  EXPECT_NE(make().out, made.out);
}

TEST_F(TokenCommandTest, NoTokenLivesLongerThanItMay) {
  EXPECT_THAT(Run({"token", "make", "--key", "k", "--issuer", "i", "--audience", "a", "--subject",
                   "s", "--lifetime", "43201"}),
              FailsWith(2, HasSubstr("--lifetime")));
}

TEST_F(TokenCommandTest, APublicKeyMakesNoToken) {
  ASSERT_THAT(Run({"token", "keygen", "--out", Path("keys"), "--rsa", "2048"}), Succeeds());
  for (const char* key : {"keys/public.pem", "keys/jwks.json", "keys/none"}) {
    EXPECT_THAT(Run({"token", "make", "--key", Path(key), "--issuer", "i", "--audience", "a",
                     "--subject", "s"}),
                FailsWith(1, AllOf(HasSubstr(key), HasSubstr("token keygen"))));
  }
}

TEST(ShowTokenTest, WhatIsNoTokenIsOneSentence) {
  for (const char* text : {"", "a", "a.b.c", "..", "e30.e30", "eyJhIjox.e30.", "\xff.\xff.\xff"}) {
    EXPECT_THAT(ShowToken(text),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no JSON Web Token")))
        << text;
  }
}

}  // namespace
}  // namespace tissueform::testing
