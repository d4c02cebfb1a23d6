// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/login_config.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace tissueform {
namespace {

// Up to the path; empty where it is no URL that a browser may log in at. What passes stands in a
// header of every answer, so only letters of host names do.
absl::string_view HttpOrigin(absl::string_view url) {
  absl::string_view rest = url;
  const bool encrypted = absl::ConsumePrefix(&rest, "https://");
  if (!encrypted && !absl::ConsumePrefix(&rest, "http://")) return {};
  const absl::string_view authority = rest.substr(0, rest.find('/'));
  const absl::string_view host = authority.substr(0, authority.rfind(':'));
  const bool is_name = !host.empty() && std::all_of(host.begin(), host.end(), [](char letter) {
    return absl::ascii_isalnum(letter) || letter == '.' || letter == '-';
  });
  int port = 443;
  const bool has_port = host.size() < authority.size();
  if (has_port && !absl::SimpleAtoi(authority.substr(host.size() + 1), &port)) return {};
  const bool is_loopback = host == "localhost" || host == "127.0.0.1";
  if (!is_name || port < 1 || port > 65535 || (!encrypted && !is_loopback)) return {};
  return url.substr(0, url.size() - rest.size() + authority.size());
}

bool IsPrintable(absl::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char letter) { return absl::ascii_isprint(letter); });
}

}  // namespace

absl::Status CheckLoginConfig(const LoginConfig& config) {
  if (config.issuer.empty() && config.client_id.empty()) return absl::OkStatus();
  if (config.client_id.empty() || config.issuer.empty()) {
    return absl::InvalidArgumentError("give both --oidc-issuer and --oidc-client-id, or neither");
  }
  const bool has_query = config.issuer.find_first_of("?# ") != std::string::npos;
  if (HttpOrigin(config.issuer).empty() || has_query || !IsPrintable(config.issuer)) {
    return absl::InvalidArgumentError(
        "--oidc-issuer must be https://HOST[:PORT][/PATH], without query (http on loopback "
        "only)");
  }
  if (config.issuer.find('{') != std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("--oidc-issuer ", config.issuer,
                     " has a placeholder; replace it with your tenant's id "
                     "in its place"));
  }
  if (!IsPrintable(config.client_id) || !IsPrintable(config.audience) ||
      !IsPrintable(config.scopes)) {
    return absl::InvalidArgumentError(
        "--oidc-client-id, --oidc-audience and --oidc-scope must be printable ASCII");
  }
  return absl::OkStatus();
}

std::string OriginOfIssuer(const LoginConfig& config) {
  return std::string(HttpOrigin(config.issuer));
}

}  // namespace tissueform
