// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/auth/token_failure.h"

#include <algorithm>

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

constexpr char kFact[] = "token";

struct Failure {
  absl::string_view name;
  absl::string_view message;
};

// In the order of the enumeration.
constexpr std::array kFailures = {
    Failure{"no_token",
            "no token came; send one in the header `authorization: Bearer TOKEN`, or log in"},
    Failure{"two_headers", "two authorization headers came; send one"},
    Failure{"not_bearer", "the authorization header is not `Bearer TOKEN`; send it in this form"},
    Failure{"too_long", "the token is longer than 8192 bytes; have the provider put less into it"},
    Failure{"malformed", "the token is no signed JSON Web Token; send the provider's as it came"},
    Failure{"key_in_header",
            "the token's header brings a key of its own; the provider must name it by `kid` alone"},
    Failure{"critical_header",
            "the token's header asks for an extension that nobody here knows; use another token"},
    Failure{"type", "the token is of a type that opens nothing here; send an access token"},
    Failure{"algorithm",
            "the token's algorithm is not that of its key; the server takes RS256 and ES256"},
    Failure{"unknown_key",
            "the token's key is not known here; if the provider has changed its keys just now, "
            "try again in a moment"},
    Failure{"signature", "the token's signature is wrong; log in again"},
    Failure{"issuer", "the token is another provider's; log in at the one of this server"},
    Failure{"audience", "the token is not made for this server; have its audience put into it"},
    Failure{"no_expiry",
            "the token does not say when it ends; have the provider put `exp` into it"},
    Failure{"expired", "the token has expired; log in again"},
    Failure{"not_yet_valid",
            "the token is not valid yet; if it is new, set the clocks of server and provider"},
    Failure{"subject",
            "the token's subject cannot be a name here; it must be 1 to 128 printable ASCII "
            "characters, and not begin with `link:`"},
    Failure{"claims", "a claim of the token is not of its kind; see docs/security.md"},
    Failure{"revoked", "the token was revoked; ask the operator, or log in again"},
};
static_assert(kFailures.size() == static_cast<size_t>(TokenFailure::kRevoked) + 1);

}  // namespace

absl::string_view TokenFailureName(TokenFailure failure) {
  return kFailures[static_cast<size_t>(failure)].name;
}

absl::Status RefuseToken(TokenFailure failure) {
  const Failure& told = kFailures[static_cast<size_t>(failure)];
  return WithReason(absl::UnauthenticatedError(told.message), ErrorReason::kUnauthenticated,
                    {{kFact, std::string(told.name)}});
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
