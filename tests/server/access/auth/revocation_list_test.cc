// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/revocation_list.h"

#include <chrono>
#include <memory>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <openssl/bn.h>

#include "server/access/auth/token_authenticator.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_tokens.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using SystemClock = std::chrono::system_clock;

Authenticated Known(const std::string& name, int64_t issued) {
  return {.principal = std::make_shared<Principal>(Principal{.name = name}),
          .token_id = std::string(64, 'a'),
          .token_name = "id-1",
          .issued = SystemClock::time_point(std::chrono::seconds(issued))};
}

TEST(RevocationListTest, HoldsTokensByDigestAndIdAndAllThatAPrincipalHadBefore) {
  ASSERT_OK_AND_ASSIGN(const auto list,
                       RevocationList::Parse(absl::StrCat(R"({"token_digests": [")",
                                                          std::string(64, 'a'), R"("]})")));
  EXPECT_TRUE(list->Holds(Known("alice", 0)));
  ASSERT_OK_AND_ASSIGN(const auto ids, RevocationList::Parse(R"({"token_ids": ["id-1"]})"));
  EXPECT_TRUE(ids->Holds(Known("alice", 0)));
  Authenticated other = Known("alice", 0);
  other.token_name = "id-2";
  EXPECT_FALSE(ids->Holds(other));
  ASSERT_OK_AND_ASSIGN(
      const auto principals,
      RevocationList::Parse(R"({"principals": {"alice": "1970-01-01T00:16:40Z"}})"));
  EXPECT_TRUE(principals->Holds(Known("alice", 999)));
  EXPECT_FALSE(principals->Holds(Known("alice", 1000)));
  EXPECT_FALSE(principals->Holds(Known("bob", 999)));
  Authenticated silent = Known("alice", 0);
  silent.issued = Authenticated().issued;
  EXPECT_TRUE(principals->Holds(silent));
}

struct BadList {
  const char* name;
  const char* text;
  const char* error;
};

class BadListTest : public ::testing::TestWithParam<BadList> {};

TEST_P(BadListTest, IsRefusedWithoutLeakingItsContent) {
  EXPECT_THAT(RevocationList::Parse(GetParam().text),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam().error)));
  const TokenFiles files;
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(files.Options()));
  Replace(files.revocations(), GetParam().text);
  ASSERT_TRUE(Soon([&] { return authenticator->standing().revocations_alarm; }));
  Replace(files.revocations(), R"({"token_ids": []})");
  ASSERT_TRUE(Soon([&] { return !authenticator->standing().revocations_alarm; }));
}

INSTANTIATE_TEST_SUITE_P(
    Lists, BadListTest,
    ::testing::Values(BadList{"Empty", "", "not a JSON object"},
                      BadList{"HalfWritten", R"({"token_ids": ["a")", "not a JSON object"},
                      BadList{"Misspelt", R"({"token_id": []})", "unknown member"},
                      BadList{"NoList", R"({"token_ids": "a"})", "not a list"},
                      BadList{"EmptyId", R"({"token_ids": [""]})", "not a list"},
                      BadList{"ShortDigest", R"({"token_digests": ["abc"]})", "64"},
                      BadList{"NoTime", R"({"principals": {"a": "yesterday"}})", "time"},
                      BadList{"PrincipalsAsList", R"({"principals": ["a"]})", "unknown member"}),
    [](const auto& test) { return std::string(test.param.name); });

// n - s in place of s signs the same, and any holder of the token can write it so.
std::string WithOtherSignature(const std::string& token) {
  const std::vector<std::string> parts = absl::StrSplit(token, '.');
  std::string bytes;
  absl::WebSafeBase64Unescape(parts[2], &bytes);
  BIGNUM* order = nullptr;
  BN_hex2bn(&order, "FFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551");
  BIGNUM* s = BN_bin2bn(reinterpret_cast<const unsigned char*>(bytes.data()) + 32, 32, nullptr);
  BN_sub(s, order, s);
  BN_bn2binpad(s, reinterpret_cast<unsigned char*>(bytes.data()) + 32, 32);
  BN_free(s);
  BN_free(order);
  return absl::StrCat(parts[0], ".", parts[1], ".", absl::WebSafeBase64Escape(bytes));
}

TEST(RevocationListTest, ATokenIsRevokedHoweverItsSignatureIsWritten) {
  const TokenFiles files;
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(files.Options()));
  const std::string token = EcKey().MakeToken(GoodClaims());
  const std::string bearer = absl::StrCat("Bearer ", token);
  const std::string other = absl::StrCat("Bearer ", WithOtherSignature(token));
  ASSERT_NE(bearer, other);
  ASSERT_OK_AND_ASSIGN(const Authenticated known,
                       authenticator->Authenticate({.authorization = {bearer}}));
  ASSERT_THAT(authenticator->Authenticate({.authorization = {other}}), IsOk());
  Replace(files.revocations(), absl::StrCat(R"({"token_digests": [")", known.token_id, R"("]})"));
  ASSERT_TRUE(Soon([&] { return authenticator->standing().revocations > 0; }));
  EXPECT_TRUE(absl::IsUnauthenticated(authenticator->IsStillAuthorized(known)));
  for (const std::string& header : {bearer, other}) {
    EXPECT_TRUE(
        absl::IsUnauthenticated(authenticator->Authenticate({.authorization = {header}}).status()));
  }
}

}  // namespace
}  // namespace tissueform::testing
