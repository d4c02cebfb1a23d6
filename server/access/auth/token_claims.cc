// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_claims.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "server/access/auth/token_failure.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;
using SystemTime = std::chrono::system_clock::time_point;

constexpr size_t kMaxNameBytes = 128;
// Times beyond are as good as this one; the clock's own type ends in 2262.
constexpr double kLastSecond = 7'258'118'400;  // of the year 2199
// Names of principals that a token must not have.
constexpr absl::string_view kLinkPrefix = "link:";

constexpr std::array<absl::string_view, 3> kTypes = {"jwt", "at+jwt", "application/at+jwt"};
constexpr std::array kRoles = {"publisher", "bridge", "admin"};

absl::StatusOr<Json> ParseObject(absl::string_view text) {
  Json object = Json::parse(text.begin(), text.end(), nullptr, false);
  if (object.is_object()) return object;
  return RefuseToken(TokenFailure::kMalformed);
}

const Json* Member(const Json& object, const char* name) {
  const auto found = object.find(name);
  return found == object.end() ? nullptr : &*found;
}

bool Is(const Json* value, absl::string_view text) {
  return value != nullptr && value->is_string() && value->get_ref<const std::string&>() == text;
}

bool IsName(const std::string& text) {
  return !text.empty() && text.size() <= kMaxNameBytes &&
         std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return absl::ascii_isprint(c); });
}

bool IsTokenType(const Json& type) {
  if (!type.is_string()) return false;
  return std::any_of(kTypes.begin(), kTypes.end(), [&](absl::string_view known) {
    return absl::EqualsIgnoreCase(type.get_ref<const std::string&>(), known);
  });
}

bool IsForOneOf(const Json* audience, const std::vector<std::string>& wanted) {
  if (audience == nullptr) return false;
  const auto is_wanted = [&](const Json& named) {
    return std::any_of(wanted.begin(), wanted.end(),
                       [&](const std::string& text) { return Is(&named, text); });
  };
  if (!audience->is_array()) return is_wanted(*audience);
  return std::any_of(audience->begin(), audience->end(), is_wanted);
}

// NumericDate of RFC 7519: seconds since 1970, also with a fraction. Unset: the claim is missing.
absl::StatusOr<std::optional<SystemTime>> TimeOf(const Json& claims, const char* name) {
  const Json* value = Member(claims, name);
  if (value == nullptr) return std::optional<SystemTime>();
  if (!value->is_number()) return RefuseToken(TokenFailure::kClaims);
  const double seconds = std::clamp(value->get<double>(), 0.0, kLastSecond);
  return std::optional<SystemTime>(SystemTime(
      std::chrono::duration_cast<SystemTime::duration>(std::chrono::duration<double>(seconds))));
}

// In whole seconds: "5m3s".
std::string InWords(SystemTime::duration time) {
  return absl::FormatDuration(
      absl::Seconds(std::chrono::duration_cast<std::chrono::seconds>(time).count()));
}

std::string TextOf(const Json& claim) {
  if (claim.is_string()) return claim.get<std::string>();
  if (!claim.is_array()) return claim.dump();
  return absl::StrJoin(claim, ", ", [](std::string* text, const Json& item) {
    absl::StrAppend(text, item.is_string() ? item.get<std::string>() : item.dump());
  });
}

std::string Quote(const Json* claim) {
  return claim == nullptr ? "not named" : QuoteForCaller(TextOf(*claim));
}

absl::Status RefuseIssuer(const Json* found, const std::string& expected) {
  return RefuseToken(TokenFailure::kIssuer, absl::StrCat("the token's issuer is ", Quote(found),
                                                         "; this server accepts only tokens of ",
                                                         QuoteForCaller(expected)));
}

absl::Status RefuseAudience(const Json* found, const std::vector<std::string>& expected) {
  return RefuseToken(TokenFailure::kAudience,
                     absl::StrCat("the token's audience is ", Quote(found), ", and this server is ",
                                  QuoteForCaller(absl::StrJoin(expected, " or "))));
}

absl::Status RefuseNotYetValid(SystemTime::duration wait, std::chrono::seconds leeway) {
  return RefuseToken(TokenFailure::kNotYetValid,
                     absl::StrCat("the token becomes valid in ", InWords(wait),
                                  " by the server's clock (tolerance ", leeway.count(), " s)"));
}

// The names in an array of strings; empty where the claim is missing.
absl::StatusOr<std::set<std::string>> NamesOf(const Json& claims, const char* name) {
  const Json* value = Member(claims, name);
  std::set<std::string> names;
  if (value == nullptr) return names;
  if (!value->is_array()) return RefuseToken(TokenFailure::kClaims);
  for (const Json& item : *value) {
    if (!item.is_string() || !IsName(item.get_ref<const std::string&>())) {
      return RefuseToken(TokenFailure::kClaims);
    }
    names.insert(item.get<std::string>());
  }
  return names;
}

absl::StatusOr<Principal> PrincipalOf(const Json& claims) {
  const Json* subject = Member(claims, "sub");
  if (subject == nullptr || !subject->is_string() ||
      !IsName(subject->get_ref<const std::string&>()) ||
      absl::StartsWith(subject->get_ref<const std::string&>(), kLinkPrefix)) {
    return RefuseToken(TokenFailure::kSubject);
  }
  Principal principal{.name = subject->get<std::string>()};
  TF_ASSIGN_OR_RETURN(const std::set<std::string> named, NamesOf(claims, "tissueform_roles"));
  for (const char* role : kRoles) {
    if (named.count(role) > 0) principal.roles.insert(role);
  }
  TF_ASSIGN_OR_RETURN(principal.projects, NamesOf(claims, "tissueform_projects"));
  return principal;
}

}  // namespace

absl::Status RefuseExpired(SystemTime expires, SystemTime now) {
  return RefuseToken(
      TokenFailure::kExpired,
      absl::StrCat("the token expired ", InWords(now - expires), " ago by the server's clock"));
}

absl::StatusOr<TokenHeader> ReadTokenHeader(absl::string_view json) {
  TF_ASSIGN_OR_RETURN(const Json header, ParseObject(json));
  for (const char* key : {"jwk", "jku", "x5u", "x5c"}) {
    if (header.contains(key)) return RefuseToken(TokenFailure::kKeyInHeader);
  }
  if (header.contains("crit")) return RefuseToken(TokenFailure::kCriticalHeader);
  if (const Json* type = Member(header, "typ"); type != nullptr && !IsTokenType(*type)) {
    return RefuseToken(TokenFailure::kType);
  }
  TokenHeader read;
  const Json* algorithm = Member(header, "alg");
  if (Is(algorithm, AlgorithmName(TokenAlgorithm::kEs256))) {
    read.algorithm = TokenAlgorithm::kEs256;
  } else if (!Is(algorithm, AlgorithmName(TokenAlgorithm::kRs256))) {
    return RefuseToken(TokenFailure::kAlgorithm);
  }
  if (const Json* kid = Member(header, "kid"); kid != nullptr) {
    if (!kid->is_string()) return RefuseToken(TokenFailure::kMalformed);
    read.kid = kid->get<std::string>();
  }
  return read;
}

absl::StatusOr<TokenClaims> ReadTokenClaims(absl::string_view json, const TokenRules& rules,
                                            SystemTime now) {
  TF_ASSIGN_OR_RETURN(const Json claims, ParseObject(json));
  if (!Is(Member(claims, "iss"), rules.issuer)) {
    return RefuseIssuer(Member(claims, "iss"), rules.issuer);
  }
  if (!IsForOneOf(Member(claims, "aud"), rules.audiences)) {
    return RefuseAudience(Member(claims, "aud"), rules.audiences);
  }
  TF_ASSIGN_OR_RETURN(const std::optional<SystemTime> expires, TimeOf(claims, "exp"));
  if (!expires.has_value()) return RefuseToken(TokenFailure::kNoExpiry);
  if (*expires + rules.leeway <= now) return RefuseExpired(*expires, now);
  TF_ASSIGN_OR_RETURN(const std::optional<SystemTime> begins, TimeOf(claims, "nbf"));
  TF_ASSIGN_OR_RETURN(const std::optional<SystemTime> issued, TimeOf(claims, "iat"));
  const SystemTime valid_from = std::max(begins.value_or(now), issued.value_or(now));
  if (valid_from > now + rules.leeway) return RefuseNotYetValid(valid_from - now, rules.leeway);
  TokenClaims read{.expires = *expires, .issued = issued};
  TF_ASSIGN_OR_RETURN(read.principal, PrincipalOf(claims));
  if (const Json* id = Member(claims, "jti"); id != nullptr) {
    if (!id->is_string()) return RefuseToken(TokenFailure::kClaims);
    read.id = id->get<std::string>();
  }
  return read;
}

}  // namespace tissueform
