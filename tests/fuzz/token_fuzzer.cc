// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "server/access/auth/key_set.h"
#include "server/access/auth/revocation_list.h"
#include "server/access/auth/token_claims.h"
#include "server/access/auth/token_text.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

constexpr char kAccepted[] = "https://login.example";

void Demand(bool promise) {
  if (!promise) std::abort();
}

// A refusal is one bounded, printable sentence for any input.
void CheckRefusal(const absl::Status& status) {
  const absl::string_view message = status.message();
  Demand(absl::IsUnauthenticated(status) && message.size() < 600);
  Demand(std::all_of(message.begin(), message.end(),
                     [](unsigned char c) { return absl::ascii_isprint(c); }));
}

void CheckHeader(absl::string_view json) {
  const absl::StatusOr<TokenHeader> header = ReadTokenHeader(json);
  if (!header.ok()) CheckRefusal(header.status());
}

void CheckClaims(absl::string_view json) {
  const TokenRules rules{.issuer = kAccepted, .audiences = {"tissueform"}};
  const auto now = std::chrono::system_clock::time_point(std::chrono::seconds(1'700'000'000));
  const absl::StatusOr<TokenClaims> claims = ReadTokenClaims(json, rules, now);
  if (!claims.ok()) {
    CheckRefusal(claims.status());
    return;
  }
  Demand(claims->expires + rules.leeway > now);
  Demand(!claims->principal.name.empty() && claims->principal.name.size() <= 128);
  Demand(claims->principal.roles.size() <= 3);
}

// Signed text and signature are what the token says, in the one way in which it can be written.
void CheckToken(absl::string_view token) {
  const absl::StatusOr<TokenParts> parts = SplitToken(token);
  if (!parts.ok()) {
    CheckRefusal(parts.status());
    return;
  }
  Demand(absl::StartsWith(token, absl::StrCat(parts->signed_text, ".")));
  CheckHeader(parts->header);
  CheckClaims(parts->claims);
}

}  // namespace

void FuzzToken(const uint8_t* data, size_t size) {
  const absl::string_view text(reinterpret_cast<const char*>(data), size);
  const std::vector<absl::string_view> headers = absl::StrSplit(text, '\n');
  const absl::StatusOr<absl::string_view> token = BearerToken(headers);
  if (token.ok()) {
    Demand(token->size() <= kMaxTokenBytes);
    CheckToken(*token);
  } else {
    CheckRefusal(token.status());
  }
  CheckToken(text);
  CheckHeader(text);
  CheckClaims(text);
}

void FuzzTokenKeys(const uint8_t* data, size_t size) {
  const absl::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto keys = KeySet::Parse(text); keys.ok()) {
    Demand((*keys)->size() >= 1 && (*keys)->SameAs(**keys));
  } else {
    Demand(absl::IsInvalidArgument(keys.status()));
  }
  const auto revocations = RevocationList::Parse(text);
  Demand(revocations.ok() || absl::IsInvalidArgument(revocations.status()));
}

}  // namespace tissueform::fuzz
