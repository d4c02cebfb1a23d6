// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <set>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "client/gateway/http_message.h"

namespace tissueform {

// Which pages may call the gateway, and under which host names. A foreign page in a browser inside
// our network must not reach it: neither under its own name (Origin), nor through a name of its own
// that resolves to our address (Host; "DNS rebinding").
class AccessRules {
 public:
  // `listen_host` as it is listened on: it and the names of loopback are allowed. `hosts`: names
  // without a port; `origins`: "https://planner.example.org".
  AccessRules(absl::string_view listen_host, const std::vector<std::string>& hosts,
              const std::vector<std::string>& origins);

  // Exactly one Host, of those that are allowed, with any port.
  bool AllowsHost(const HttpHead& head) const;

  // No Origin (no browser asks, or for a page of ours), the one of the Host itself, or one of those
  // that are allowed. Never "null", never two.
  bool AllowsOrigin(const HttpHead& head) const;

  // Whether this is an origin of another host that was allowed by name: it needs CORS headers.
  bool IsForeignOrigin(absl::string_view origin) const;

 private:
  // Lower case.
  std::set<std::string> hosts_;
  std::set<std::string> origins_;
};

}  // namespace tissueform
