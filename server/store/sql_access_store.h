// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/access_rows.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Changes rows of rights; access_queries.h finds them. All block and are durable when they return.
// Thread-safe. Errors, where none is named: those of SqlDatabase.
class SqlAccessStore {
 public:
  // `database` must outlive it.
  explicit SqlAccessStore(SqlDatabase* database) : database_(database) {}

  // Of one resource of the owner's, by principal, rising. Damaged rows are left out.
  absl::StatusOr<std::vector<ShareRow>> SharesOf(const std::string& owner,
                                                 const std::string& resource);

  // In place of the share with its key. Errors: NotFound (its owner has no such resource; a project
  // needs none), ResourceExhausted (HasNoRoom: it would be one more than `most` of the resource).
  absl::Status PutShare(const ShareRow& share, int most);
  // Errors: NotFound.
  absl::Status EraseShare(const ShareRow& share);

  // Erases links that have expired, too. Errors: NotFound (the session is gone), ResourceExhausted
  // (HasNoRoom: it would be one more than `most` of the session).
  absl::Status PutLink(const FollowLinkRow& link, int64_t now_s, int most);
  absl::Status EraseLinks(const std::string& session);

  absl::Status PutMeshRight(const MeshRight& right);
  absl::Status EraseMeshRight(const std::string& principal, const std::string& sha256);
  absl::Status EraseMeshRights(const std::string& sha256);

 private:
  SqlDatabase* const database_;
};

// Whether a Put was refused for its `most`, and not for a full disk.
bool HasNoRoom(const absl::Status& status);

}  // namespace tissueform
