// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>

#include "nlohmann/json.hpp"

namespace tissueform {

// How the times of a token stand to a clock.
enum class TokenDate { kInDate, kNotYetValid, kEnded, kWithoutEnd };

struct TokenState {
  TokenDate date = TokenDate::kInDate;
  std::string words;  // "lasts 59 min", "ended 2 h ago"
};

// By the claims `nbf`, `iat` and `exp`. A token that begins within a minute is in date, since
// servers grant clocks as much.
TokenState TokenStateAt(const nlohmann::json& claims, std::chrono::system_clock::time_point now);

// The claims `iat`, `nbf` and `exp` that the token has, by name: "2026-11-26 01:00:00 UTC, in 59
// min". Empty if no claim of them is a number.
nlohmann::json TokenTimesAt(const nlohmann::json& claims,
                            std::chrono::system_clock::time_point now);

}  // namespace tissueform
