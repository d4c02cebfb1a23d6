// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_authenticator.h"

#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "core/base/error_reason.h"
#include "tests/testing/test_tokens.h"

namespace tissueform {
namespace {

using testing::EcKey;
using testing::GoodClaims;
using testing::OtherEcKey;
using testing::RsaKey;
using testing::SecondsFromNow;
using testing::TokenFiles;
using testing::With;
using testing::Without;
using Json = nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

absl::StatusOr<Authenticated> Ask(Authenticator* authenticator, const std::string& token) {
  const std::string bearer = absl::StrCat("Bearer ", token);
  return authenticator->Authenticate({.authorization = {bearer}});
}

std::unique_ptr<TokenAuthenticator> StartWith(const TokenOptions& options) {
  auto authenticator = TokenAuthenticator::Start(options);
  EXPECT_TRUE(authenticator.ok()) << authenticator.status();
  return *std::move(authenticator);
}

std::string FailureIn(const absl::Status& status) {
  const ErrorInfo info = ErrorInfoOf(status);
  const auto found = info.metadata.find("token");
  return found == info.metadata.end() ? "" : found->second;
}

Json Header(const SigningKey& key) {
  return {{"alg", key.algorithm()}, {"kid", key.kid()}, {"typ", "JWT"}};
}

std::string Hs256WithPublicKey() {
  const std::string text =
      absl::StrCat(absl::WebSafeBase64Escape(With(Header(RsaKey()), "alg", "HS256").dump()), ".",
                   absl::WebSafeBase64Escape(GoodClaims().dump()));
  const std::string secret = RsaKey().PublicPem();
  std::array<unsigned char, EVP_MAX_MD_SIZE> mac{};
  unsigned int size = 0;
  HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
       reinterpret_cast<const unsigned char*>(text.data()), text.size(), mac.data(), &size);
  return absl::StrCat(text, ".",
                      absl::WebSafeBase64Escape(
                          absl::string_view(reinterpret_cast<const char*>(mac.data()), size)));
}

// The same bytes written in a second way, which lax decoders take.
std::string WithTrailingBits(std::string token) {
  constexpr absl::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  token.back() = kDigits[kDigits.find(token.back()) ^ 1];
  return token;
}

std::string WithClaims(const Json& claims) { return EcKey().MakeToken(claims); }
std::string WithHeader(const std::string& name, const Json& value) {
  return EcKey().MakeToken(With(Header(EcKey()), name, value), GoodClaims());
}
std::string WithSignatureOf(const std::string& bytes) {
  const std::vector<std::string> parts = absl::StrSplit(EcKey().MakeToken(GoodClaims()), '.');
  return absl::StrCat(parts[0], ".", parts[1], ".", absl::WebSafeBase64Escape(bytes));
}

struct BadToken {
  const char* name;
  const char* failure;
  std::function<std::string()> make;
};

const std::vector<BadToken>& BadTokens() {
  static const auto* tokens = new std::vector<BadToken>{
      {"Expired", "expired",
       [] { return WithClaims(With(GoodClaims(), "exp", SecondsFromNow(-61))); }},
      {"WithoutExpiry", "no_expiry", [] { return WithClaims(Without(GoodClaims(), "exp")); }},
      {"ExpiryAsText", "claims", [] { return WithClaims(With(GoodClaims(), "exp", "tomorrow")); }},
      {"ExpiryBelowZero", "expired", [] { return WithClaims(With(GoodClaims(), "exp", -1e300)); }},
      {"NotYetValid", "not_yet_valid",
       [] { return WithClaims(With(GoodClaims(), "nbf", SecondsFromNow(90))); }},
      {"FromTheFuture", "not_yet_valid",
       [] { return WithClaims(With(GoodClaims(), "iat", SecondsFromNow(90))); }},
      {"WrongIssuer", "issuer",
       [] { return WithClaims(With(GoodClaims(), "iss", "https://login.example/")); }},
      {"WithoutIssuer", "issuer", [] { return WithClaims(Without(GoodClaims(), "iss")); }},
      {"WrongAudience", "audience",
       [] { return WithClaims(With(GoodClaims(), "aud", "tissuefor")); }},
      {"ListOfWrongAudiences", "audience",
       [] {
         return WithClaims(With(GoodClaims(), "aud", Json::array({"a", 1, nullptr})));
       }},
      {"WithoutAudience", "audience", [] { return WithClaims(Without(GoodClaims(), "aud")); }},
      {"WithoutSubject", "subject", [] { return WithClaims(Without(GoodClaims(), "sub")); }},
      {"EmptySubject", "subject", [] { return WithClaims(With(GoodClaims(), "sub", "")); }},
      {"SubjectTooLong", "subject",
       [] { return WithClaims(With(GoodClaims(), "sub", std::string(129, 'a'))); }},
      {"SubjectNotAscii", "subject",
       [] { return WithClaims(With(GoodClaims(), "sub", "alic\xC3\xA9")); }},
      {"SubjectOfALink", "subject", [] { return WithClaims(With(GoodClaims(), "sub", "link:1")); }},
      {"RolesAsText", "claims",
       [] { return WithClaims(With(GoodClaims(), "tissueform_roles", "admin")); }},
      {"ProjectsWithNumbers", "claims",
       [] { return WithClaims(With(GoodClaims(), "tissueform_projects", Json::array({1}))); }},
      {"IdAsNumber", "claims", [] { return WithClaims(With(GoodClaims(), "jti", 1)); }},
      {"ClaimsNoObject", "malformed", [] { return WithClaims(Json::array({1})); }},
      {"AlgorithmNone", "algorithm", [] { return WithHeader("alg", "none"); }},
      {"AlgorithmNoneUnsigned", "algorithm",
       [] {
         return absl::StrCat(absl::WebSafeBase64Escape(R"({"alg":"none"})"), ".",
                             absl::WebSafeBase64Escape(GoodClaims().dump()), ".");
       }},
      {"AlgorithmOne", "algorithm", [] { return WithHeader("alg", 1); }},
      {"AlgorithmOfAnotherKey", "algorithm", [] { return WithHeader("alg", "RS256"); }},
      {"AlgorithmMissing", "algorithm",
       [] { return EcKey().MakeToken(Without(Header(EcKey()), "alg"), GoodClaims()); }},
      {"Hs256WithThePublicKey", "algorithm", Hs256WithPublicKey},
      {"OwnJwk", "key_in_header",
       [] {
         return OtherEcKey().MakeToken(
             With(Header(OtherEcKey()), "jwk", OtherEcKey().PublicJwks()["keys"][0]), GoodClaims());
       }},
      {"OwnJku", "key_in_header", [] { return WithHeader("jku", "https://evil.example/keys"); }},
      {"OwnX5u", "key_in_header", [] { return WithHeader("x5u", "https://evil.example/cert"); }},
      {"OwnX5c", "key_in_header", [] { return WithHeader("x5c", Json::array({"MIIB"})); }},
      {"CriticalExtension", "critical_header",
       [] { return WithHeader("crit", Json::array({"b64"})); }},
      {"TypeOfALogout", "type", [] { return WithHeader("typ", "logout+jwt"); }},
      {"UnknownKid", "unknown_key", [] { return OtherEcKey().MakeToken(GoodClaims()); }},
      {"KidIsAPath", "unknown_key", [] { return WithHeader("kid", "../../dev/null"); }},
      {"KidIsANumber", "malformed", [] { return WithHeader("kid", 1); }},
      {"OtherSignature", "signature",
       [] { return OtherEcKey().MakeToken(Header(EcKey()), GoodClaims()); }},
      {"SignatureOfZeros", "signature", [] { return WithSignatureOf(std::string(64, '\0')); }},
      {"SignatureTooShort", "signature", [] { return WithSignatureOf(std::string(63, '\1')); }},
      {"WithoutSignature", "signature", [] { return WithSignatureOf(""); }},
      {"SignatureWithTrailingBits", "malformed",
       [] { return WithTrailingBits(EcKey().MakeToken(GoodClaims())); }},
      {"Padded", "malformed", [] { return EcKey().MakeToken(GoodClaims()) + "=="; }},
      {"FourParts", "malformed", [] { return EcKey().MakeToken(GoodClaims()) + ".x"; }},
      {"NotJson", "malformed", [] { return std::string("aaaa.bbbb.cccc"); }},
      {"EmptyParts", "malformed", [] { return std::string(".."); }},
      {"OfAMegabyte", "too_long", [] { return std::string(1 << 20, 'a'); }},
      {"JustTooLong", "too_long", [] { return std::string(8193, 'a'); }},
  };
  return *tokens;
}

class BadTokenTest : public ::testing::TestWithParam<BadToken> {};

TEST_P(BadTokenTest, IsRefusedWithAReasonButNoneOfItsContent) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  const std::string token = GetParam().make();
  const absl::StatusOr<Authenticated> known = Ask(authenticator.get(), token);
  ASSERT_TRUE(absl::IsUnauthenticated(known.status())) << known.status();
  EXPECT_EQ(FailureIn(known.status()), GetParam().failure);
  EXPECT_EQ(authenticator->failures().Counts().at(GetParam().failure), 1);
  const std::string message(known.status().message());
  for (const absl::string_view part : absl::StrSplit(token, '.')) {
    EXPECT_TRUE(part.empty() || !absl::StrContains(message, part)) << message;
  }
  EXPECT_THAT(message, Not(HasSubstr("alice")));
  // It has left nothing behind: a good one is taken.
  EXPECT_TRUE(Ask(authenticator.get(), EcKey().MakeToken(GoodClaims())).ok());
}

INSTANTIATE_TEST_SUITE_P(Tokens, BadTokenTest, ::testing::ValuesIn(BadTokens()),
                         [](const auto& test) { return std::string(test.param.name); });

// The sentence of a refusal of a token with this claim.
std::string SentenceOf(const std::string& name, const Json& value) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  return std::string(
      Ask(authenticator.get(), WithClaims(With(GoodClaims(), name, value))).status().message());
}

TEST(RefusedTokenTest, ErrorOfASignedTokenStatesTheExpectedClaim) {
  EXPECT_THAT(SentenceOf("iss", "https://sts.example/1/"),
              HasSubstr("issuer is \"https://sts.example/1/\"; this server accepts only tokens of "
                        "\"https://login.example\""));
  EXPECT_THAT(SentenceOf("iss", nullptr), HasSubstr("issuer is \"null\""));
  EXPECT_THAT(SentenceOf("aud", "another"),
              HasSubstr("audience is \"another\", and this server is \"tissueform\""));
  EXPECT_THAT(SentenceOf("aud", Json::array({"a", 1})), HasSubstr("audience is \"a, 1\", and"));
}

TEST(RefusedTokenTest, ErrorStatesTheClockDifference) {
  const TokenFiles files;
  const auto now = std::chrono::system_clock::now();
  const auto at = [&](std::chrono::seconds later) {
    return *TokenAuthenticator::Start(files.Options(), [=] { return now + later; });
  };
  const int64_t second =
      std::chrono::duration_cast<std::chrono::seconds>(now.time_since_epoch()).count();
  Json claims = With(With(GoodClaims(), "iat", second), "exp", second + 600);
  const std::string token = WithClaims(claims);
  EXPECT_THAT(std::string(Ask(at(std::chrono::seconds(-301)).get(), token).status().message()),
              HasSubstr("becomes valid in 5m"));
  EXPECT_THAT(std::string(Ask(at(std::chrono::seconds(901)).get(), token).status().message()),
              HasSubstr("expired 5m"));
}

TEST(RefusedTokenTest, TheErrorQuotesAClaimBoundedAndPrintable) {
  const std::string sentence =
      SentenceOf("iss", absl::StrCat("https://e\x1b[31m\"\n\u00e9", std::string(5000, 'a')));
  EXPECT_THAT(sentence, HasSubstr("\"https://e?[31m????aaa"));
  EXPECT_LT(sentence.size(), 450);
  EXPECT_THAT(SentenceOf("aud", Json::array({std::string(5000, 'a')})).size(), ::testing::Lt(450));
}

TEST(RefusedTokenTest, ErrorRevealsNothingOfATokenWithABadSignature) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  const Json claims = With(GoodClaims(), "iss", "https://unverified.example");
  for (const std::string& token :
       {OtherEcKey().MakeToken(Header(EcKey()), claims), OtherEcKey().MakeToken(claims)}) {
    const std::string sentence(Ask(authenticator.get(), token).status().message());
    EXPECT_THAT(sentence, Not(HasSubstr("unverified"))) << sentence;
  }
  EXPECT_THAT(
      std::string(Ask(authenticator.get(), OtherEcKey().MakeToken(claims)).status().message()),
      HasSubstr("does not belong to \"https://login.example\""));
}

struct GoodToken {
  const char* name;
  std::function<std::string()> make;
};

class GoodTokenTest : public ::testing::TestWithParam<GoodToken> {};

TEST_P(GoodTokenTest, IsTakenAgainAndAgain) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  const std::string token = GetParam().make();
  for (int i = 0; i < 3; ++i) {
    const absl::StatusOr<Authenticated> known = Ask(authenticator.get(), token);
    ASSERT_TRUE(known.ok()) << known.status();
    EXPECT_EQ(known->principal->name, "alice");
    EXPECT_TRUE(authenticator->IsStillAuthorized(*known).ok());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Tokens, GoodTokenTest,
    ::testing::Values(
        GoodToken{"Es256", [] { return EcKey().MakeToken(GoodClaims()); }},
        GoodToken{"Rs256", [] { return RsaKey().MakeToken(GoodClaims()); }},
        GoodToken{"WithoutKid",
                  [] { return EcKey().MakeToken(Without(Header(EcKey()), "kid"), GoodClaims()); }},
        GoodToken{"WithoutType",
                  [] { return EcKey().MakeToken(Without(Header(EcKey()), "typ"), GoodClaims()); }},
        GoodToken{"AccessTokenOfRfc9068", [] { return WithHeader("typ", "at+JWT"); }},
        GoodToken{"ListOfAudiences",
                  [] {
                    return WithClaims(With(GoodClaims(), "aud", Json::array({"x", "tissueform"})));
                  }},
        GoodToken{"JustExpired",
                  [] { return WithClaims(With(GoodClaims(), "exp", SecondsFromNow(-30))); }},
        GoodToken{"AlmostValid",
                  [] { return WithClaims(With(GoodClaims(), "nbf", SecondsFromNow(30))); }},
        GoodToken{"ExpiryWithAFraction",
                  [] { return WithClaims(With(GoodClaims(), "exp", SecondsFromNow(60) + 0.5)); }},
        GoodToken{"ExpiryBeyondAllClocks",
                  [] { return WithClaims(With(GoodClaims(), "exp", 1e300)); }}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(TokenAuthenticatorTest, TwoAuthorizationHeadersAreRefusedEvenIfEachIsGood) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  const std::string bearer = absl::StrCat("Bearer ", EcKey().MakeToken(GoodClaims()));
  EXPECT_EQ(FailureIn(authenticator->Authenticate({.authorization = {bearer, bearer}}).status()),
            "two_headers");
  EXPECT_EQ(FailureIn(authenticator->Authenticate({}).status()), "no_token");
  for (const absl::string_view header : {"", "Basic YTpi", "Bearer", "Bearer ", "bear"}) {
    EXPECT_EQ(FailureIn(authenticator->Authenticate({.authorization = {header}}).status()),
              "not_bearer")
        << header;
  }
}

TEST(TokenAuthenticatorTest, RolesAndProjectsAreThoseOfTheToken) {
  const TokenFiles files;
  const auto authenticator = StartWith(files.Options());
  Json claims = GoodClaims();
  claims["tissueform_roles"] = {"admin", "emperor", "publisher"};
  claims["tissueform_projects"] = {"jaws"};
  claims["jti"] = "token-1";
  const absl::StatusOr<Authenticated> known = Ask(authenticator.get(), WithClaims(claims));
  ASSERT_TRUE(known.ok()) << known.status();
  EXPECT_EQ(known->principal->roles, (std::set<std::string>{"admin", "publisher"}));
  EXPECT_EQ(known->principal->projects, std::set<std::string>{"jaws"});
  EXPECT_EQ(known->token_name, "token-1");
  EXPECT_EQ(known->token_id.size(), 64U);
}

TEST(TokenAuthenticatorTest, ATokenEndsByTheClockAlsoWhenItIsCached) {
  const TokenFiles files;
  auto now = std::chrono::system_clock::now();
  auto authenticator = *TokenAuthenticator::Start(files.Options(), [&] { return now; });
  const std::string token = EcKey().MakeToken(GoodClaims());
  const absl::StatusOr<Authenticated> known = Ask(authenticator.get(), token);
  ASSERT_TRUE(known.ok()) << known.status();
  now += std::chrono::minutes(60);
  EXPECT_TRUE(authenticator->IsStillAuthorized(*known).ok());
  now += std::chrono::seconds(61);
  EXPECT_EQ(FailureIn(authenticator->IsStillAuthorized(*known)), "expired");
  EXPECT_EQ(FailureIn(Ask(authenticator.get(), token).status()), "expired");
}

}  // namespace
}  // namespace tissueform
