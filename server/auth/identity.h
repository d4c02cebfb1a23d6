// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// Who makes a call, and so whose its sessions are. Nobody logs in yet: everyone is anonymous.
struct Principal {
  std::string name;  // empty: anonymous; never logged

  bool anonymous() const { return name.empty(); }

  friend bool operator==(const Principal&, const Principal&) = default;
};

// 128 random bits in 32 hexadecimal digits: who does not know an id does not guess it.
std::string RandomId();

}  // namespace tissueform
