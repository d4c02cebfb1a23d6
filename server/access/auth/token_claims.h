// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/access/auth/identity.h"
#include "server/access/auth/verification_key.h"

namespace tissueform {

// What a token must say.
struct TokenRules {
  std::string issuer = {};
  std::vector<std::string> audiences = {};  // one of them
  // By how much clocks may differ.
  std::chrono::seconds leeway{60};
};

// What the server takes from a token's header.
struct TokenHeader {
  TokenAlgorithm algorithm = TokenAlgorithm::kRs256;
  std::optional<std::string> kid = {};
};

// `json`: as TokenParts has it. Errors: RefuseToken's (malformed, key_in_header, critical_header,
// type, algorithm).
absl::StatusOr<TokenHeader> ReadTokenHeader(absl::string_view json);

// The refusal of a token that ended at `expires`, with how long ago that was at `now`.
absl::Status RefuseExpired(std::chrono::system_clock::time_point expires,
                           std::chrono::system_clock::time_point now);

// What the server takes from a token's claims.
struct TokenClaims {
  Principal principal = {};
  std::chrono::system_clock::time_point expires = {};  // `exp`
  // `iat`; unset: the token does not say.
  std::optional<std::chrono::system_clock::time_point> issued = {};
  std::string id = {};  // `jti`; empty: the token has none
};

// REQUIRES: the token's signature was verified, since errors name its issuer, audience and times.
//
// Errors: RefuseToken's (malformed, issuer, audience, no_expiry, expired, not_yet_valid, subject,
// claims).
absl::StatusOr<TokenClaims> ReadTokenClaims(absl::string_view json, const TokenRules& rules,
                                            std::chrono::system_clock::time_point now);

}  // namespace tissueform
