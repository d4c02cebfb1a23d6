// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/access_rows.h"
#include "server/store/case_store.h"
#include "server/store/sql_database.h"

namespace tissueform {

// What a principal was given of a resource: by a share of the resource or of its project, the
// higher role of both. Unset: nothing. The owner needs no share.
struct SessionGrant {
  std::string owner = {};
  std::string mesh_sha256 = {};
  std::optional<ShareRole> role = {};
};
struct PredictionGrant {
  std::string owner = {};
  std::optional<ShareRole> role = {};
  // Of the session that it was made in, where that is still there and of the same owner.
  std::optional<SessionGrant> session = {};
};
struct CaseGrant {
  CaseKey key = {};
  std::optional<ShareRole> role = {};
};
// A project of one owner; others have theirs under the same name.
struct ProjectKey {
  std::string owner = {};
  std::string name = {};

  friend auto operator<=>(const ProjectKey&, const ProjectKey&) = default;
};
// A follow link, and what its maker has of its session. Unset: the session is gone.
struct LinkGrant {
  FollowLinkRow link = {};
  std::optional<SessionGrant> maker = {};
};

// Who uses a mesh.
struct MeshUse {
  std::set<std::string> senders = {};            // principals who have sent its bytes
  std::map<std::string, int64_t> sessions = {};  // number of sessions by owner
};

// How much one principal has stored.
struct Holdings {
  int64_t sessions = 0;
  int64_t bytes = 0;  // of meshes, cases and predictions
};

// What a store says of who may do what, by the indexed columns beside its records
// (store_schema.h). Each answer was true at one moment.
//
// A row of rights counts only while its seal holds: damage never grants access. All block.
// Thread-safe. Errors: those of SqlDatabase.
class AccessQueries {
 public:
  // `database` must outlive it.
  explicit AccessQueries(SqlDatabase* database) : database_(database) {}

  // Unset where there is no such resource. FindSession and the two of links wait for a database
  // that servers share at most 2 s: they are asked while someone drags or watches.
  absl::StatusOr<std::optional<SessionGrant>> FindSession(const std::string& id,
                                                          const std::string& principal);
  absl::StatusOr<std::optional<PredictionGrant>> FindPrediction(const std::string& id,
                                                                const std::string& principal);
  // All cases of this file, by owner.
  absl::StatusOr<std::vector<CaseGrant>> FindCases(const std::string& sha256,
                                                   const std::string& principal);
  absl::StatusOr<std::optional<LinkGrant>> FindLink(const std::string& digest);
  absl::StatusOr<std::vector<LinkGrant>> LinksOf(const std::string& session);

  absl::StatusOr<MeshUse> FindMeshUse(const std::string& sha256);
  // Whether the principal owns, or was given, a session or a prediction with this mesh.
  absl::StatusOr<bool> IsMeshShown(const std::string& sha256, const std::string& principal);
  absl::StatusOr<std::set<std::string>> PredictionsOfMesh(const std::string& sha256);
  // At least the meshes that the principal has sent or is shown.
  absl::StatusOr<std::set<std::string>> MeshesNear(const std::string& principal);

  // What others have given to the principal.
  absl::StatusOr<std::set<std::string>> SharedSessions(const std::string& principal);
  absl::StatusOr<std::set<std::string>> SharedPredictions(const std::string& principal);
  absl::StatusOr<std::set<CaseKey>> SharedCases(const std::string& principal);
  absl::StatusOr<std::map<ProjectKey, ShareRole>> SharedProjects(const std::string& principal);
  // Of the predictions named, those that exist: their owners.
  absl::StatusOr<std::set<std::string>> OwnersOfPredictions(const std::set<std::string>& ids);

  absl::StatusOr<std::map<std::string, Holdings>> HoldingsByOwner();
  absl::StatusOr<Holdings> HoldingsOf(const std::string& owner);

 private:
  SqlDatabase* const database_;
};

// For the transactions that delete a resource: its shares and links go with it, so that the next
// resource of its name starts with none.
absl::Status EraseAccessToSession(SqlTransaction& transaction, const std::string& owner,
                                  const std::string& id);
absl::Status EraseAccessToPrediction(SqlTransaction& transaction, const std::string& owner,
                                     const std::string& id);
absl::Status EraseAccessToCase(SqlTransaction& transaction, const CaseKey& key);
absl::Status EraseAccessToMesh(SqlTransaction& transaction, const std::string& sha256);

}  // namespace tissueform
