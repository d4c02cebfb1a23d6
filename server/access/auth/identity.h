// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <set>
#include <string>

namespace tissueform {

// Who makes a call, and so whose its sessions are.
struct Principal {
  // Who it is, by the name that resources, shares and quotas know it by; empty: anonymous, as
  // everybody is on a server without logins. Goes to the audit log and to no other.
  std::string name = {};
  // What its token says of it, by the names of docs/security.md: "publisher", "bridge", "admin".
  std::set<std::string> roles = {};
  std::set<std::string> projects = {};
  // Of a follow link: the only session that it may look at; empty: any.
  std::string only_session = {};

  bool anonymous() const { return name.empty(); }

  friend bool operator==(const Principal&, const Principal&) = default;
};

}  // namespace tissueform
