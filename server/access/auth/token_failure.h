// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Why a token is refused; docs/security.md says what each one means and what to do.
enum class TokenFailure {
  kNoToken,
  kTwoHeaders,
  kNotBearer,
  kTooLong,
  kMalformed,
  kKeyInHeader,
  kCriticalHeader,
  kType,
  kAlgorithm,
  kUnknownKey,
  kSignature,
  kIssuer,
  kAudience,
  kNoExpiry,
  kExpired,
  kNotYetValid,
  kSubject,
  kClaims,
  kRevoked,
};

// As metrics and errors name it: "unknown_key". Names never change their meaning.
absl::string_view TokenFailureName(TokenFailure failure);

// Unauthenticated, with a sentence that says what to do and holds nothing of the token; the
// failure's name is the fact "token" that goes with the reason UNAUTHENTICATED.
absl::Status RefuseToken(TokenFailure failure);
// The same with facts before it. Claims may be in them only after the token's signature was
// verified, and only as QuoteForCaller writes them.
absl::Status RefuseToken(TokenFailure failure, absl::string_view facts);

// Text for a message to an unauthenticated caller: in double quotes, at most 200 bytes of it; all
// but printable ASCII and quotes is replaced by "?".
std::string QuoteForCaller(absl::string_view text);

// How many tokens were refused, by reason. Thread-safe; never blocks.
class TokenFailures {
 public:
  // Nothing where `refusal` was not made by RefuseToken.
  void Count(const absl::Status& refusal);
  int64_t count(TokenFailure failure) const;
  // Of every failure, also those that never were.
  std::map<std::string, int64_t> Counts() const;

 private:
  std::array<std::atomic<int64_t>, static_cast<size_t>(TokenFailure::kRevoked) + 1> counts_ = {};
};

}  // namespace tissueform
