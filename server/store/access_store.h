// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/access_rows.h"

namespace tissueform {

struct AccessRows {
  std::vector<ShareRow> shares = {};
  std::vector<FollowLinkRow> links = {};
  std::vector<MeshRight> mesh_rights = {};
};

// Where it is kept who may do what with whose. tests/server/store/access_store_contract_test.cc
// holds the contract.
//
// Thread-safe.
class AccessStore {
 public:
  virtual ~AccessStore() = default;

  // All rows, of each kind by its key, rising. Damaged ones are left out: damage never
  // grants access. Blocks. Errors: what the disk says.
  virtual absl::StatusOr<AccessRows> Load() = 0;

  // Takes rows out by their keys, then puts rows in, in place of those with their keys; all or
  // nothing. `done` when that is as durable as the store is: once, on any thread; it may not block.
  virtual void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) = 0;
};

}  // namespace tissueform
