// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_failure.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

constexpr char kFact[] = "token";
constexpr size_t kMaxQuotedBytes = 200;

struct Failure {
  absl::string_view name;
  absl::string_view message;
};

// In the order of the enumeration. What stands here of issuer, audience, times and an unknown key
// follows facts.
constexpr std::array kFailures = {
    Failure{"no_token",
            "no token; send one in the header `authorization: Bearer TOKEN`, or log in"},
    Failure{"two_headers", "two authorization headers; send one"},
    Failure{"not_bearer", "the authorization header must be `Bearer TOKEN`"},
    Failure{"too_long",
            "the token is longer than 8192 bytes; configure the provider to include less"},
    Failure{"malformed", "the token is not a signed JSON Web Token; send it unchanged"},
    Failure{"key_in_header",
            "the token's header contains a key; the provider must refer to it by `kid`"},
    Failure{"critical_header",
            "the token's header requires an unknown extension; use another token"},
    Failure{"type", "the token has the wrong type; send an access token"},
    Failure{"algorithm",
            "the token's algorithm does not match its key; the server accepts RS256 and ES256"},
    Failure{"unknown_key",
            "log in there, or try again in a moment if that provider has just changed its keys"},
    Failure{"signature", "the token's signature is wrong; log in again"},
    Failure{"issuer", "log in there, or correct the server's --token-issuer"},
    Failure{"audience",
            "configure the provider to name it, or correct the server's --token-audience "
            "corrected"},
    Failure{"no_expiry", "the token has no expiry; configure the provider to add `exp`"},
    Failure{"expired",
            "log in again, or set the clocks of server and provider if the token is new"},
    Failure{"not_yet_valid", "set the clocks of server and provider"},
    Failure{"subject",
            "the token's subject is not a valid name; it must be 1 to 128 printable ASCII "
            "characters, and not begin with `link:`"},
    Failure{"claims", "a claim of the token has the wrong type; see docs/security.md"},
    Failure{"revoked", "the token was revoked; ask the operator, or log in again"},
};
static_assert(kFailures.size() == static_cast<size_t>(TokenFailure::kRevoked) + 1);

}  // namespace

absl::string_view TokenFailureName(TokenFailure failure) {
  return kFailures[static_cast<size_t>(failure)].name;
}

absl::Status RefuseToken(TokenFailure failure) { return RefuseToken(failure, ""); }

absl::Status RefuseToken(TokenFailure failure, absl::string_view facts) {
  const Failure& known = kFailures[static_cast<size_t>(failure)];
  return WithReason(
      absl::UnauthenticatedError(absl::StrCat(facts, facts.empty() ? "" : "; ", known.message)),
      ErrorReason::kUnauthenticated, {{kFact, std::string(known.name)}});
}

std::string QuoteForCaller(absl::string_view text) {
  std::string printable(text.substr(0, kMaxQuotedBytes));
  std::replace_if(
      printable.begin(), printable.end(),
      [](unsigned char c) { return !absl::ascii_isprint(c) || c == '"'; }, '?');
  return absl::StrCat("\"", printable, text.size() > kMaxQuotedBytes ? "...\"" : "\"");
}

void TokenFailures::Count(const absl::Status& refusal) {
  const ErrorInfo info = ErrorInfoOf(refusal);
  const auto name = info.metadata.find(kFact);
  if (name == info.metadata.end()) return;
  const auto* found = std::find_if(kFailures.begin(), kFailures.end(), [&](const Failure& failure) {
    return failure.name == name->second;
  });
  if (found != kFailures.end()) ++counts_[static_cast<size_t>(found - kFailures.begin())];
}

int64_t TokenFailures::count(TokenFailure failure) const {
  return counts_[static_cast<size_t>(failure)];
}

std::map<std::string, int64_t> TokenFailures::Counts() const {
  std::map<std::string, int64_t> counts;
  for (size_t i = 0; i < kFailures.size(); ++i) counts[std::string(kFailures[i].name)] = counts_[i];
  return counts;
}

}  // namespace tissueform
