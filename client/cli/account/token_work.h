// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

namespace tissueform {

// No token lives longer than this: who finds one shall not have it for long.
inline constexpr int64_t kMaxTokenLifetimeSeconds = int64_t{12} * 3600;

// What a token that is made here says.
struct TokenWords {
  std::string issuer = {};
  std::vector<std::string> audiences = {};
  std::string subject = {};
  int64_t lifetime_seconds = 3600;
  std::vector<std::string> roles = {};
  std::vector<std::string> projects = {};
};

// The claims, from `now` on, with an id of its own (`jti`).
nlohmann::json ClaimsOf(const TokenWords& words, std::chrono::system_clock::time_point now);

// Writes private.pem (readable by its owner alone), public.pem and jwks.json into `folder`, which
// is made; nothing that is there is written over. `rsa_bits` 0: a key of P-256.
//
// Errors: AlreadyExists, or what the system says, naming the file.
absl::Status MakeKeyFiles(const std::string& folder, int rsa_bits);

// A token signed with the private key in that file. Errors: naming the file.
absl::StatusOr<std::string> MakeTokenWith(const std::string& key_file, const TokenWords& words);

// What a token says, unverified and without its signature, as JSON: "header", "claims", "state"
// (whether it is in date by the clock `now`), "times" for people, and "token_digest" (its name in a
// revocation list). Errors: InvalidArgument.
absl::StatusOr<nlohmann::json> ShowToken(absl::string_view token,
                                         std::chrono::system_clock::time_point now);

// The same of the token in a file, white space around it aside. Errors: those of ShowToken, and
// NotFound, naming the file.
absl::StatusOr<nlohmann::json> ShowTokenFile(const std::string& path,
                                             std::chrono::system_clock::time_point now);

}  // namespace tissueform
