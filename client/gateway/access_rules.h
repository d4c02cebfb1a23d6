// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <set>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "client/gateway/http_message.h"

namespace tissueform {

// From which pages the gateway may be asked, and by which names. A page of somebody else that a
// browser behind our network shows must not reach it: neither by its own name (Origin), nor by a
// name of its own that turns to our address (Host; "DNS rebinding").
class AccessRules {
 public:
  // `listen_host` as it is listened on: it and the names of loopback are allowed. `hosts`: names
  // without a port; `origins`: "https://planner.example.org".
  AccessRules(absl::string_view listen_host, const std::vector<std::string>& hosts,
              const std::vector<std::string>& origins);

  // Exactly one Host, of those that are allowed, whatever its port.
  bool AllowsHost(const HttpHead& head) const;

  // No Origin (no browser asks, or for a page of ours), the one of the Host itself, or one of those
  // that are allowed. Never "null", never two.
  bool AllowsOrigin(const HttpHead& head) const;

  // Whether this is an origin of another host that was allowed by name: it needs to be told so.
  bool IsForeignOrigin(absl::string_view origin) const;

 private:
  // Lower case.
  std::set<std::string> hosts_;
  std::set<std::string> origins_;
};

}  // namespace tissueform
