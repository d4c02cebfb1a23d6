// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/access/access_options.h"
#include "server/store/sql_access_store.h"

namespace tissueform {

// What changes who may do what: shares, follow links, who has sent a mesh. (A deleted resource
// takes its rights with it: access_queries.h.)
//
// A change counts everywhere, and is durable, when it returns. All block on the store. Thread-safe.
class AccessChanges {
 public:
  // Both must outlive it.
  AccessChanges(const AccessOptions& options, SqlAccessStore* store, Access* access)
      : options_(options), store_(*store), access_(*access) {}

  const AccessOptions& options() const { return options_; }
  Access& access() const { return access_; }

  // Shares a resource of the caller's own; again: with this role. Shares of a project may come
  // before the project.
  //
  // Errors: InvalidArgument (the names), NotFound, PermissionDenied, ResourceExhausted.
  absl::Status Share(const Principal& caller, ShareRow share);
  // Errors: those of Share; NotFound: no such share.
  absl::Status Unshare(const Principal& caller, const std::string& resource,
                       const std::string& with);
  absl::StatusOr<std::vector<ShareRow>> SharesOf(const Principal& caller,
                                                 const std::string& resource);

  // Keeps a follow link that the caller has created. Errors: those of Access::CheckSessionAccess
  // (kWrite) and CheckCaseAccess; ResourceExhausted.
  absl::Status AddLink(const Principal& caller, FollowLinkRow link);
  // All of the session. Errors: those of Access::CheckSessionAccess (kWrite).
  absl::Status RemoveLinks(const Principal& caller, const std::string& session);

  // The caller has sent the bytes of the mesh, and wants it no more.
  absl::Status GrantMesh(const Principal& caller, const std::string& sha256, int64_t bytes);
  absl::Status ReleaseMesh(const Principal& caller, const std::string& sha256);
  // The mesh is gone from a server that stores none.
  void MeshRemoved(const std::string& sha256);

 private:
  absl::Status MayOwn(const Principal& caller, const std::string& resource);
  absl::Status CheckLink(const Principal& caller, const FollowLinkRow& link);

  const AccessOptions options_;
  SqlAccessStore& store_;
  Access& access_;
};

}  // namespace tissueform
