// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/access_store.h"

namespace tissueform {

// The rows of an AccessStore as they are asked for. Not thread-safe.
class ShareTable {
 public:
  void Add(const AccessRows& rows);
  void Remove(const AccessRows& rows);

  // What the owner has let the principal do with the resource; empty: nothing.
  std::optional<ShareRole> RoleOf(const std::string& owner, const std::string& resource,
                                  const std::string& principal) const;
  // Of one resource, by principal, rising.
  std::vector<ShareRow> SharesOf(const std::string& owner, const std::string& resource) const;

  // Null where there is none.
  const FollowLinkRow* FindLink(const std::string& digest) const;
  std::vector<FollowLinkRow> LinksOf(const std::string& session) const;
  // Those that have ended by then (unix seconds).
  std::vector<FollowLinkRow> LinksUntil(int64_t now_s) const;

  bool HasMesh(const std::string& principal, const std::string& sha256) const;
  // Who has sent the mesh, and its bytes.
  using Holders = std::map<std::string, int64_t>;
  const Holders& HoldersOf(const std::string& sha256) const;

 private:
  using Shared = std::pair<std::string, std::string>;  // owner, resource

  void Remove(const ShareRow& row);
  void Remove(const FollowLinkRow& row);
  void Remove(const MeshRight& row);

  std::map<Shared, std::map<std::string, ShareRole>> shares_;  // by principal
  std::map<std::string, FollowLinkRow> links_;                 // by digest
  std::map<std::string, std::set<std::string>> links_of_session_;
  std::map<std::string, Holders> holders_of_mesh_;
};

}  // namespace tissueform
