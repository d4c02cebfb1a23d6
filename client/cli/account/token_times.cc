// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/token_times.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"

namespace tissueform {
namespace {

constexpr double kLeewaySeconds = 60;
constexpr double kLongestSeconds = 1e12;

// Rounded down: a token that lasts "1 min" lasts no less.
std::string InWords(double duration_seconds) {
  const auto seconds = static_cast<int64_t>(std::min(duration_seconds, kLongestSeconds));
  if (seconds < 120) return absl::StrCat(seconds, " s");
  if (seconds < 7200) return absl::StrCat(seconds / 60, " min");
  if (seconds < 172800) return absl::StrCat(seconds / 3600, " h");
  return absl::StrCat(seconds / 86400, " days");
}

std::optional<double> SecondsOf(const nlohmann::json& claims, const char* name) {
  const auto found = claims.find(name);
  if (found == claims.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

double SecondsUntil(double time, std::chrono::system_clock::time_point now) {
  return time - std::chrono::duration<double>(now.time_since_epoch()).count();
}

}  // namespace

TokenState TokenStateAt(const nlohmann::json& claims, std::chrono::system_clock::time_point now) {
  const std::optional<double> expires = SecondsOf(claims, "exp");
  if (!expires.has_value()) return {TokenDate::kWithoutEnd, "without an expiry (exp)"};
  const double left = SecondsUntil(*expires, now);
  if (left <= 0) return {TokenDate::kEnded, absl::StrCat("ended ", InWords(-left), " ago")};
  double wait = 0;
  for (const char* name : {"nbf", "iat"}) {
    wait = std::max(wait, SecondsUntil(SecondsOf(claims, name).value_or(0), now));
  }
  if (wait > kLeewaySeconds)
    return {TokenDate::kNotYetValid, absl::StrCat("becomes valid in ", InWords(wait))};
  return {TokenDate::kInDate, absl::StrCat("lasts ", InWords(left))};
}

nlohmann::json TokenTimesAt(const nlohmann::json& claims,
                            std::chrono::system_clock::time_point now) {
  nlohmann::json times = nlohmann::json::object();
  for (const char* name : {"iat", "nbf", "exp"}) {
    const std::optional<double> seconds = SecondsOf(claims, name);
    if (!seconds.has_value()) continue;
    const double left = SecondsUntil(*seconds, now);
    times[name] = absl::StrCat(
        absl::FormatTime("%Y-%m-%d %H:%M:%S UTC", absl::UnixEpoch() + absl::Seconds(*seconds),
                         absl::UTCTimeZone()),
        left > 0 ? ", in " : ", ", InWords(std::abs(left)), left > 0 ? "" : " ago");
  }
  return times;
}

}  // namespace tissueform
