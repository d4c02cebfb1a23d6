// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/access_rules.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace tissueform {
namespace {

// "[::1]:8080" and "planner.example.org:443" without their ports.
absl::string_view WithoutPort(absl::string_view host) {
  if (absl::StartsWith(host, "[")) {
    const size_t end = host.find(']');
    return end == absl::string_view::npos ? host : host.substr(0, end + 1);
  }
  return host.substr(0, host.find(':'));
}

// An IPv6 address stands in brackets in a URL.
std::string AsInUrl(absl::string_view host) {
  const bool bare_ipv6 = absl::StrContains(host, ':') && !absl::StartsWith(host, "[");
  return absl::AsciiStrToLower(bare_ipv6 ? absl::StrCat("[", host, "]") : std::string(host));
}

}  // namespace

AccessRules::AccessRules(absl::string_view listen_host, const std::vector<std::string>& hosts,
                         const std::vector<std::string>& origins)
    : hosts_{"localhost", "127.0.0.1", "[::1]", AsInUrl(listen_host)} {
  for (const std::string& host : hosts) hosts_.insert(AsInUrl(host));
  for (const std::string& origin : origins) origins_.insert(absl::AsciiStrToLower(origin));
}

bool AccessRules::AllowsHost(const HttpHead& head) const {
  if (head.Count("host") != 1) return false;
  return hosts_.count(absl::AsciiStrToLower(WithoutPort(head.Field("host")))) != 0;
}

bool AccessRules::AllowsOrigin(const HttpHead& head) const {
  if (head.Count("origin") == 0) return true;
  if (head.Count("origin") != 1) return false;
  const std::string origin = absl::AsciiStrToLower(head.Field("origin"));
  if (origins_.count(origin) != 0) return true;
  absl::string_view host = origin;
  // TLS may end before the gateway, so both are its own.
  if (!absl::ConsumePrefix(&host, "http://") && !absl::ConsumePrefix(&host, "https://")) {
    return false;
  }
  return host == absl::AsciiStrToLower(head.Field("host"));
}

bool AccessRules::IsForeignOrigin(absl::string_view origin) const {
  return origins_.count(absl::AsciiStrToLower(origin)) != 0;
}

}  // namespace tissueform
