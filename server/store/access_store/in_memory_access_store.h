// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/store/access_store/access_rows.h"
#include "server/store/access_store/access_store.h"

namespace tissueform {

// Of a server that keeps nothing.
class InMemoryAccessStore final : public AccessStore {
 public:
  absl::StatusOr<AccessRows> Load() override {
    AccessRows rows;
    MutexLock lock(mutex_);
    for (const auto& [key, row] : shares_) rows.shares.push_back(row);
    for (const auto& [key, row] : links_) rows.links.push_back(row);
    for (const auto& [key, row] : mesh_rights_) rows.mesh_rights.push_back(row);
    return rows;
  }

  void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) override {
    {
      MutexLock lock(mutex_);
      for (const ShareRow& row : erase.shares) shares_.erase(KeyOf(row));
      for (const FollowLinkRow& row : erase.links) links_.erase(KeyOf(row));
      for (const MeshRight& row : erase.mesh_rights) mesh_rights_.erase(KeyOf(row));
      for (const ShareRow& row : put.shares) shares_[KeyOf(row)] = row;
      for (const FollowLinkRow& row : put.links) links_[KeyOf(row)] = row;
      for (const MeshRight& row : put.mesh_rights) mesh_rights_[KeyOf(row)] = row;
    }
    done(absl::OkStatus());
  }

 private:
  Mutex mutex_;
  std::map<std::string, ShareRow> shares_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, FollowLinkRow> links_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, MeshRight> mesh_rights_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
