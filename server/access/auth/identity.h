// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <set>
#include <string>

namespace tissueform {

// Who makes a call, and so whose its sessions are.
struct Principal {
  // The name by which resources, shares and quotas know the principal; empty: anonymous, as every
  // caller is on a server without logins. It goes to the audit log and to no other log.
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
