// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/share_table.h"

namespace tissueform {
namespace {

// Takes `value` out of the set of `key`, and that with its last one.
void EraseFrom(std::map<std::string, std::set<std::string>>* sets, const std::string& key,
               const std::string& value) {
  const auto found = sets->find(key);
  if (found == sets->end()) return;
  found->second.erase(value);
  if (found->second.empty()) sets->erase(found);
}

}  // namespace

void ShareTable::Add(const AccessRows& rows) {
  for (const ShareRow& row : rows.shares) {
    shares_[{row.owner, row.resource}][row.principal] = row.role;
  }
  for (const FollowLinkRow& row : rows.links) {
    links_[row.digest] = row;
    links_of_session_[row.session].insert(row.digest);
  }
  for (const MeshRight& row : rows.mesh_rights) {
    holders_of_mesh_[row.sha256][row.principal] = row.bytes;
  }
}

void ShareTable::Remove(const AccessRows& rows) {
  for (const ShareRow& row : rows.shares) Remove(row);
  for (const FollowLinkRow& row : rows.links) Remove(row);
  for (const MeshRight& row : rows.mesh_rights) Remove(row);
}

void ShareTable::Remove(const ShareRow& row) {
  const auto found = shares_.find({row.owner, row.resource});
  if (found == shares_.end() || found->second.erase(row.principal) == 0) return;
  if (found->second.empty()) shares_.erase(found);
}

void ShareTable::Remove(const FollowLinkRow& row) {
  links_.erase(row.digest);
  EraseFrom(&links_of_session_, row.session, row.digest);
}

void ShareTable::Remove(const MeshRight& row) {
  const auto mesh = holders_of_mesh_.find(row.sha256);
  if (mesh == holders_of_mesh_.end()) return;
  mesh->second.erase(row.principal);
  if (mesh->second.empty()) holders_of_mesh_.erase(mesh);
}

std::optional<ShareRole> ShareTable::RoleOf(const std::string& owner, const std::string& resource,
                                            const std::string& principal) const {
  const auto found = shares_.find({owner, resource});
  if (found == shares_.end()) return std::nullopt;
  const auto role = found->second.find(principal);
  return role == found->second.end() ? std::nullopt : std::optional<ShareRole>(role->second);
}

std::vector<ShareRow> ShareTable::SharesOf(const std::string& owner,
                                           const std::string& resource) const {
  std::vector<ShareRow> rows;
  const auto found = shares_.find({owner, resource});
  if (found == shares_.end()) return rows;
  for (const auto& [principal, role] : found->second) {
    rows.push_back({.resource = resource, .owner = owner, .principal = principal, .role = role});
  }
  return rows;
}

const FollowLinkRow* ShareTable::FindLink(const std::string& digest) const {
  const auto found = links_.find(digest);
  return found == links_.end() ? nullptr : &found->second;
}

std::vector<FollowLinkRow> ShareTable::LinksOf(const std::string& session) const {
  std::vector<FollowLinkRow> rows;
  const auto found = links_of_session_.find(session);
  if (found == links_of_session_.end()) return rows;
  for (const std::string& digest : found->second) rows.push_back(links_.at(digest));
  return rows;
}

std::vector<FollowLinkRow> ShareTable::LinksUntil(int64_t now_s) const {
  std::vector<FollowLinkRow> rows;
  for (const auto& [digest, row] : links_) {
    if (row.expires_s <= now_s) rows.push_back(row);
  }
  return rows;
}

bool ShareTable::HasMesh(const std::string& principal, const std::string& sha256) const {
  return HoldersOf(sha256).contains(principal);
}

const ShareTable::Holders& ShareTable::HoldersOf(const std::string& sha256) const {
  static const auto* none = new Holders();
  const auto found = holders_of_mesh_.find(sha256);
  return found == holders_of_mesh_.end() ? *none : found->second;
}

}  // namespace tissueform
