// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>

namespace tissueform {

// Limits of shares and follow links.
struct AccessOptions {
  int max_shares_per_resource = 256;
  int max_links_per_session = 32;
  std::chrono::hours max_link_lifetime{24 * 7};
};

// Of a follow link whose maker says nothing.
inline constexpr std::chrono::hours kUsualLinkLifetime{8};

}  // namespace tissueform
