// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/access/token_words.h"

#include <optional>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "nlohmann/json.hpp"

#include "client/cpp/server_channel.h"

namespace tissueform {
namespace {

constexpr char kCheck[] = "token";
constexpr char kLogIn[] = "log in again (`tissueform login`), or have another one made";

// Of a JWT; nothing when it is none.
std::optional<nlohmann::json> ClaimsOf(const std::string& token) {
  const std::vector<std::string> parts = absl::StrSplit(token, '.');
  std::string payload;
  if (parts.size() != 3 || !absl::WebSafeBase64Unescape(parts[1], &payload)) return std::nullopt;
  nlohmann::json claims = nlohmann::json::parse(payload, nullptr, /*allow_exceptions=*/false);
  if (!claims.is_object()) return std::nullopt;
  return claims;
}

std::string TextClaim(const nlohmann::json& claims, const char* name) {
  const auto found = claims.find(name);
  if (found == claims.end()) return "-";
  if (found->is_string()) return found->get<std::string>();
  if (!found->is_array()) return "?";
  std::string all;
  for (const nlohmann::json& one : *found) {
    if (one.is_string()) absl::StrAppend(&all, all.empty() ? "" : " ", one.get<std::string>());
  }
  return all;
}

std::string TimeLeft(double seconds) {
  const auto minutes = static_cast<int64_t>(seconds / 60);
  if (minutes < 120) return absl::StrCat(minutes, " min");
  return minutes < 2880 ? absl::StrCat(minutes / 60, " h") : absl::StrCat(minutes / 1440, " days");
}

}  // namespace

DoctorLine CheckToken(const ConnectionOptions& options, std::chrono::system_clock::time_point now) {
  const auto file = OpenTokenOf(options);
  if (!file.ok()) {
    return {.check = kCheck,
            .finding = Finding::kFailed,
            .text = std::string(file.status().message()),
            .advice = kLogIn};
  }
  if (*file == nullptr) {
    return {.check = kCheck, .finding = Finding::kSkipped, .text = "none is given (--token-file)"};
  }
  const std::optional<nlohmann::json> claims = ClaimsOf((*file)->Current());
  if (!claims.has_value()) {
    return {.check = kCheck, .text = "one that says nothing of itself (a follow link?)"};
  }
  DoctorLine line = {
      .check = kCheck,
      .text = absl::StrCat("of ", TextClaim(*claims, "sub"), ", from ", TextClaim(*claims, "iss"),
                           " for ", TextClaim(*claims, "aud"))};
  const auto expires = claims->find("exp");
  if (expires == claims->end() || !expires->is_number()) {
    line.finding = Finding::kFailed;
    absl::StrAppend(&line.text, ", without an end (exp)");
    line.advice = "servers take no token without one; have another one made";
    return line;
  }
  const double left =
      expires->get<double>() - std::chrono::duration<double>(now.time_since_epoch()).count();
  if (left <= 0) {
    line.finding = Finding::kFailed;
    absl::StrAppend(&line.text, ", ended ", TimeLeft(-left), " ago by this machine's clock");
    line.advice = kLogIn;
  } else {
    absl::StrAppend(&line.text, ", lasts ", TimeLeft(left));
  }
  return line;
}

}  // namespace tissueform
