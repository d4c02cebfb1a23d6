// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_options.h"

#include "absl/strings/str_cat.h"

namespace tissueform {

bool TokenOptions::configured() const {
  return !issuer.empty() || !audiences.empty() || !keys_file.empty() || !jwks_url.empty() ||
         !revocations_file.empty();
}

void AddTokenOptions(CLI::App& app, TokenOptions* options) {
  app.add_option("--token-issuer", options->issuer,
                 "issuer of accepted tokens, exactly as in their claim `iss`; "
                 "without --token-* there is no login, and every caller can access everything")
      ->type_name("URL");
  app.add_option("--token-audience", options->audiences,
                 "this server's name in the claim `aud` (repeatable)")
      ->type_name("NAME")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  CLI::Option* file =
      app.add_option("--token-keys", options->keys_file,
                     "file with the issuer's public keys (PEM, or a JSON Web Key Set); changes are "
                     "read while the server runs")
          ->type_name("FILE");
  app.add_option("--token-jwks-url", options->jwks_url,
                 "URL of the issuer's keys: https, or http on this machine; fetched every 15 "
                 "minutes, and when a token names an unknown key")
      ->type_name("URL")
      ->excludes(file);
  app.add_option("--token-revocations", options->revocations_file,
                 "JSON file of revoked tokens and principals (docs/security.md); "
                 "changes apply within a second")
      ->type_name("FILE");
}

absl::Status CheckTokenOptions(const TokenOptions& options) {
  if (options.issuer.empty()) {
    return absl::InvalidArgumentError("tokens need --token-issuer: the accepted `iss`");
  }
  if (options.issuer.find('{') != std::string::npos) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--token-issuer ", options.issuer, " has a placeholder; replace it with your tenant's id"));
  }
  if (options.audiences.empty()) {
    return absl::InvalidArgumentError("tokens need --token-audience: this server's name in `aud`");
  }
  if (options.keys_file.empty() == options.jwks_url.empty()) {
    return absl::InvalidArgumentError(
        "tokens need the issuer's keys: give one of --token-keys and --token-jwks-url");
  }
  if (options.jwks_url.empty()) return absl::OkStatus();
  const absl::Status url = CheckJwksUrl(options.jwks_url);
  return url.ok() ? url
                  : absl::InvalidArgumentError(absl::StrCat("--token-jwks-url: ", url.message()));
}

}  // namespace tissueform
