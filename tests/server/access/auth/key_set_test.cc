// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/key_set.h"

#include <functional>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/access/auth/token_authenticator.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_tokens.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

Json WithKey(const std::string& name, const Json& value) {
  Json set = EcKey().PublicJwks();
  set["keys"][0][name] = value;
  return set;
}

struct BadKeys {
  const char* name;
  const char* error;
  std::function<std::string()> make;
};

class BadKeysTest : public ::testing::TestWithParam<BadKeys> {};

TEST_P(BadKeysTest, AreRefusedAtTheStartInOneLine) {
  const TokenFiles files;
  Replace(files.keys(), GetParam().make());
  const absl::Status status = TokenAuthenticator::Start(files.Options()).status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam().error)));
  EXPECT_TRUE(absl::StartsWith(status.message(), "--token-keys: ")) << status;
  EXPECT_FALSE(absl::StrContains(status.message(), "\n"));
}

TEST_P(BadKeysTest, LeaveTheOldKeysInUseWhileTheServerRuns) {
  const TokenFiles files;
  ASSERT_OK_AND_ASSIGN(const auto authenticator, TokenAuthenticator::Start(files.Options()));
  Replace(files.keys(), GetParam().make());
  ASSERT_TRUE(Soon([&] { return authenticator->standing().keys_alarm; }));
  const std::string bearer = absl::StrCat("Bearer ", EcKey().MakeToken(GoodClaims()));
  EXPECT_THAT(authenticator->Authenticate({.authorization = {bearer}}), IsOk());
}

INSTANTIATE_TEST_SUITE_P(
    Keys, BadKeysTest,
    ::testing::Values(
        BadKeys{"Empty", "BEGIN PUBLIC KEY", [] { return std::string(); }},
        BadKeys{"Nonsense", "BEGIN PUBLIC KEY", [] { return std::string("\xff\0nonsense", 10); }},
        BadKeys{"TooLarge", "larger than", [] { return std::string((1 << 20) + 1, ' '); }},
        BadKeys{"PrivatePem", "private key", [] { return EcKey().PrivatePem(); }},
        BadKeys{"PrivateJwk", "private key", [] { return WithKey("d", "AQAB").dump(); }},
        BadKeys{"ShortRsaPem", "has 1024 bits",
                [] { return SigningKey::MakeRsa(1024)->PublicPem(); }},
        BadKeys{"ShortRsaJwk", "has 1024 bits",
                [] { return SigningKey::MakeRsa(1024)->PublicJwks().dump(); }},
        BadKeys{"HugeRsaJwk", "too large",
                [] {
                  Json set = RsaKey().PublicJwks();
                  set["keys"][0]["n"] = std::string(4000, 'A');
                  return set.dump();
                }},
        BadKeys{"ExponentOfOne", "exponent",
                [] {
                  Json set = RsaKey().PublicJwks();
                  set["keys"][0]["e"] = "AQ";
                  return set.dump();
                }},
        BadKeys{"NoPointOfTheCurve", "not a point",
                [] { return WithKey("y", std::string(43, 'A')).dump(); }},
        BadKeys{"CoordinateTooShort", "32 bytes", [] { return WithKey("x", "AAAA").dump(); }},
        BadKeys{"CoordinateMissing", "\"x\" is missing", [] { return WithKey("x", 7).dump(); }},
        BadKeys{"TwoOfOneName", "same `kid`", [] { return JwksOf(EcKey(), EcKey()); }},
        BadKeys{"OnlyForEncryption", "no key", [] { return WithKey("use", "enc").dump(); }},
        BadKeys{"OnlyForPs256", "no key", [] { return WithKey("alg", "PS256").dump(); }},
        BadKeys{"NoKeys", "no key", [] { return std::string(R"({"keys": []})"); }},
        BadKeys{"NoSet", "Key Set", [] { return std::string(R"({"key": 1})"); }},
        BadKeys{"HalfASet", "Key Set", [] { return EcKey().PublicJwks().dump().substr(0, 80); }},
        BadKeys{"KeyIsNoObject", "not a JSON object",
                [] { return std::string(R"({"keys": [1]})"); }},
        BadKeys{"PemAndSomethingElse", "something other",
                [] {
                  return EcKey().PublicPem() +
                         "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
                }},
        BadKeys{"DamagedPem", "", [] { return EcKey().PublicPem().replace(60, 4, "AAAA"); }}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(KeySetTest, AKeyFileThatIsNotThereIsOneLine) {
  TokenOptions options{.issuer = kIssuer, .audiences = {kAudience}};
  options.keys_file = "/nowhere/keys.pem";
  EXPECT_THAT(TokenAuthenticator::Start(options).status(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("--token-keys: it cannot be")));
  options.keys_file = "/dev/zero";
  EXPECT_THAT(TokenAuthenticator::Start(options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a regular file")));
}

TEST(KeySetTest, OtherKeysOfAProviderArePassedOver) {
  Json set = EcKey().PublicJwks();
  set["keys"].push_back({{"kty", "OKP"}, {"crv", "Ed25519"}, {"x", "AAAA"}});
  set["keys"].push_back({{"kty", "EC"}, {"crv", "P-384"}, {"x", "AAAA"}, {"y", "AAAA"}});
  ASSERT_OK_AND_ASSIGN(const auto keys, KeySet::Parse(set.dump()));
  EXPECT_EQ(keys->size(), 1);
}

TEST(KeySetTest, PemAndJwksOfAKeyAreTheSame) {
  for (const SigningKey* key : {&EcKey(), &RsaKey()}) {
    ASSERT_OK_AND_ASSIGN(const auto pem, KeySet::Parse(key->PublicPem()));
    ASSERT_OK_AND_ASSIGN(const auto jwks, KeySet::Parse(key->PublicJwks().dump()));
    EXPECT_TRUE(pem->SameAs(*jwks));
  }
}

TEST(KeySetTest, AKeyWithoutANameIsFoundOnlyWhereItIsTheOnlyOne) {
  ASSERT_OK_AND_ASSIGN(const auto two,
                       KeySet::Parse(EcKey().PublicPem() + OtherEcKey().PublicPem()));
  EXPECT_EQ(two->Find(std::nullopt, TokenAlgorithm::kEs256), nullptr);
  ASSERT_OK_AND_ASSIGN(const auto one, KeySet::Parse(JwksOf(EcKey(), RsaKey())));
  EXPECT_NE(one->Find(std::nullopt, TokenAlgorithm::kEs256), nullptr);
  EXPECT_EQ(one->Find("", TokenAlgorithm::kEs256), nullptr);
}

}  // namespace
}  // namespace tissueform::testing
