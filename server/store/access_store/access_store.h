// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// What somebody may do with another's resource. Each may all that the ones before may.
enum class ShareRole { kViewer = 1, kPlanner = 2 };

// By owner, resource and principal there is one.
struct ShareRow {
  // "sessions/{id}", "cases/{sha256}", "predictions/{id}", or "projects/{name}": all that the owner
  // has in the project.
  std::string resource = {};
  std::string owner = {};
  std::string principal = {};  // to whom
  ShareRole role = ShareRole::kViewer;

  friend bool operator==(const ShareRow&, const ShareRow&) = default;
};

struct FollowLinkRow {
  std::string digest = {};  // SHA-256 of its token
  std::string session = {};
  std::string maker = {};
  std::string case_sha256 = {};  // that it opens, too; empty: none
  int64_t expires_s = 0;         // unix seconds

  friend bool operator==(const FollowLinkRow&, const FollowLinkRow&) = default;
};

// Who has sent the bytes of a mesh.
struct MeshRight {
  std::string principal = {};
  std::string sha256 = {};
  int64_t bytes = 0;  // of the mesh

  friend bool operator==(const MeshRight&, const MeshRight&) = default;
};

struct AccessRows {
  std::vector<ShareRow> shares = {};
  std::vector<FollowLinkRow> links = {};
  std::vector<MeshRight> mesh_rights = {};
};

// Where it is kept who may do what with whose. tests/server/store/access_store holds the contract.
//
// Thread-safe.
class AccessStore {
 public:
  virtual ~AccessStore() = default;

  // All rows, of each kind by its key, rising. Damaged ones are passed over: nobody may more by
  // damage. Blocks. Errors: what the disk says.
  virtual absl::StatusOr<AccessRows> Load() = 0;

  // Takes rows out by their keys, then puts rows in, in place of those with their keys; all or
  // nothing. `done` when that is as durable as the store is: once, on any thread; it may not block.
  virtual void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) = 0;
};

}  // namespace tissueform
