// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/token_words.h"

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "client/cli/account/token_times.h"
#include "client/cli/account/token_work.h"
#include "client/cpp/server_channel.h"

namespace tissueform {
namespace {

constexpr char kCheck[] = "token";
constexpr char kLogIn[] = "log in again (`tissueform login`), or get another token";

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

std::string AdviceFor(TokenDate date) {
  if (date == TokenDate::kWithoutEnd) {
    return "servers reject tokens without an expiry; get another token";
  }
  return absl::StrCat(
      date == TokenDate::kEnded ? absl::StrCat(kLogIn, "; ") : "",
      "if the token is new, this machine's clock is wrong: synchronize it with NTP");
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
    return {.check = kCheck, .finding = Finding::kSkipped, .text = "no token (--token-file)"};
  }
  const absl::StatusOr<nlohmann::json> shown = ShowToken((*file)->Current(), now);
  if (!shown.ok()) {
    return {.check = kCheck, .text = "opaque token (a follow link?)"};
  }
  const nlohmann::json& claims = (*shown)["claims"];
  const TokenState state = TokenStateAt(claims, now);
  DoctorLine line = {
      .check = kCheck,
      .text = absl::StrCat("of ", TextClaim(claims, "sub"), ", from ", TextClaim(claims, "iss"),
                           " for ", TextClaim(claims, "aud"), ", ", state.words)};
  if (state.date == TokenDate::kInDate) return line;
  line.finding = state.date == TokenDate::kWithoutEnd ? Finding::kFailed : Finding::kWarning;
  line.advice = AdviceFor(state.date);
  // The server's clock decides, and the one here may be wrong.
  if (line.finding == Finding::kWarning) absl::StrAppend(&line.text, " by this machine's clock");
  return line;
}

}  // namespace tissueform
