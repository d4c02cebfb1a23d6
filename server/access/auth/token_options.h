// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

#include "server/access/auth/jwks_fetcher.h"

namespace tissueform {

// Whose tokens a server takes. Without any of the options there are no logins.
struct TokenOptions {
  std::string issuer = {};
  std::vector<std::string> audiences = {};
  // One of these two.
  std::string keys_file = {};
  std::string jwks_url = {};
  std::string revocations_file = {};  // empty: nothing is revoked

  // No options of the program.
  std::chrono::seconds leeway{60};
  std::chrono::milliseconds file_period{250};  // how often files are looked at
  JwksTimes jwks_times = {};

  bool configured() const;
};

// Adds the `--token-*` options to `app`; parsing writes into `options`, which must outlive it.
void AddTokenOptions(CLI::App& app, TokenOptions* options);

// That nothing is missing. Errors: InvalidArgument, naming the options.
absl::Status CheckTokenOptions(const TokenOptions& options);

}  // namespace tissueform
