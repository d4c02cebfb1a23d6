// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform {

// IPv4 addresses and networks ("10.1.2.0/24") that may connect.
class AddressSet {
 public:
  // Errors: InvalidArgument, with the text.
  static absl::StatusOr<AddressSet> Parse(const std::vector<std::string>& texts);

  bool Contains(const std::string& address) const;

 private:
  struct Network {
    uint32_t bits = 0;
    uint32_t mask = 0;
  };
  std::vector<Network> networks_;
};

}  // namespace tissueform
