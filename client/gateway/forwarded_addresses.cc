// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/forwarded_addresses.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "server/platform/network_address.h"

namespace tissueform {

ForwardedAddresses::ForwardedAddresses(const std::vector<std::string>& proxies) {
  for (const std::string& proxy : proxies) proxies_.insert(AddressOr(proxy));
}

absl::Status ForwardedAddresses::CheckProxies(const std::vector<std::string>& proxies) {
  for (const std::string& proxy : proxies) {
    if (AddressOr(proxy).empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "--trust-forwarded-from ", proxy, ": not an address; write 192.0.2.1 or 2001:db8::1"));
    }
  }
  return absl::OkStatus();
}

std::string ForwardedAddresses::Of(const HttpHead& head) const {
  std::string address = AddressOr(head.peer);
  std::vector<absl::string_view> chain;
  for (const auto& [name, value] : head.fields) {
    if (name != "x-forwarded-for") continue;
    for (const absl::string_view part : absl::StrSplit(value, ',')) chain.push_back(part);
  }
  // Each proxy appends the address that it received the request from.
  while (!chain.empty() && proxies_.contains(address)) {
    std::string before = AddressOr(absl::StripAsciiWhitespace(chain.back()));
    chain.pop_back();
    if (before.empty()) break;
    address = std::move(before);
  }
  return address;
}

}  // namespace tissueform
