// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "client/gateway/http_message.h"

namespace tissueform {

// Where requests come from, behind proxies that say so in X-Forwarded-For. Any client can write
// that header: only the entries that a trusted proxy has appended count.
class ForwardedAddresses {
 public:
  // `proxies`: addresses that pass CheckProxies.
  explicit ForwardedAddresses(const std::vector<std::string>& proxies = {});

  // Error: InvalidArgument when one is no address.
  static absl::Status CheckProxies(const std::vector<std::string>& proxies);

  // The last address of the chain that is not a trusted proxy, by the header as far as trusted
  // proxies have written it, else the other end's. Empty if that is not an address.
  std::string Of(const HttpHead& head) const;

 private:
  std::set<std::string> proxies_;
};

}  // namespace tissueform
