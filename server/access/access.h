// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/auth/identity.h"
#include "server/exports/export_queue.h"
#include "server/store/access_queries.h"
#include "server/store/session_store.h"

namespace tissueform {

// Access to a resource; each level includes the ones before.
enum class Permission {
  kRead,   // read it, watch it
  kWrite,  // drag it and keep its answers
  kOwner,  // change it, delete it, share it
};

// Decides which principal may do what, in this one place (docs/security.md, "Permissions").
//
// Every check asks the store once. A resource that a principal may not read gives NotFound, exactly
// as a missing one does; PermissionDenied is only for readable resources. A resource without an
// owner is open to anonymous callers, and to them alone.
//
// While a database that servers share does not answer, what was allowed to a principal for a
// session in the last kRememberedWhenAway before stays allowed: this server may still hold the
// session by a lease, which ends by itself.
//
// Checks block, those of sessions and links at most 2 s. Errors of all, in addition to those named:
// Unavailable (the database does not answer). Thread-safe.
class Access {
 public:
  static constexpr std::chrono::seconds kRememberedWhenAway{10};
  // For so long after it has not answered, the database is not asked again for sessions and links.
  static constexpr std::chrono::seconds kNotAskedAgain{1};
  // How long a follow link that was good needs no question: its watchers acknowledge every frame.
  static constexpr std::chrono::seconds kLinkRemembered{1};

  // Both must outlive it. `exports` says what is to go to the PACS; null: nothing is.
  explicit Access(AccessQueries* queries, UnixClock clock = SystemUnixSeconds,
                  const ExportQueue* exports = nullptr)
      : queries_(*queries), clock_(std::move(clock)), exports_(exports) {}

  // Whether the principal may call a method ("CaseService.UploadCase") at all: publishers publish,
  // and a follow link follows. Errors: PermissionDenied.
  static absl::Status CheckMethodAccess(const Principal& caller, std::string_view method);
  // Whether new resources may go into the project; empty: none. Errors: InvalidArgument,
  // PermissionDenied.
  static absl::Status CheckProjectAccess(const Principal& caller, const std::string& project);

  // Whether there is a resource of this name. Anonymous callers may use names that do not exist:
  // the code that uses the resource then reports that it is missing.
  enum class Found { kYes, kNo };

  // Errors: NotFound, PermissionDenied; Unauthenticated for a follow link that has ended.
  absl::StatusOr<Found> CheckSessionAccess(const Principal& caller, const std::string& id,
                                           Permission need);
  // As CheckSessionAccess, for a call that lasts and was allowed when it began. OK for a session
  // that is gone, and while the database does not answer: what uses it ends with the reason.
  absl::Status RecheckSessionAccess(const Principal& caller, const std::string& id,
                                    Permission need);
  // Errors: NotFound, PermissionDenied.
  absl::StatusOr<Found> CheckPredictionAccess(const Principal& caller, const std::string& id,
                                              Permission need);
  // Whose case the caller's name of it means: its own, else the first that it may look at. Errors:
  // NotFound, PermissionDenied.
  absl::StatusOr<CaseKey> CheckCaseAccess(const Principal& caller, const std::string& sha256,
                                          Permission need);
  // A mesh is looked at, and sessions are made of it, by who has sent its bytes and who may look at
  // a session or a prediction that holds it; who has sent its bytes owns it. Errors: NotFound,
  // PermissionDenied.
  absl::Status CheckMeshAccess(const Principal& caller, const std::string& sha256, Permission need);
  // At least the meshes that the caller may look at; unset: any.
  absl::StatusOr<std::optional<std::set<std::string>>> MeshesNear(const Principal& caller);
  absl::StatusOr<MeshUse> FindMeshUse(const std::string& sha256) {
    return queries_.FindMeshUse(sha256);
  }

  // Whose exports the caller sees: its own; unset: all, as bridges do.
  static std::optional<std::string> ExportsSeenBy(const Principal& caller);
  // An export that is the owner's. Errors: NotFound, PermissionDenied.
  static absl::Status CheckExportAccess(const Principal& caller, const std::string& owner,
                                        const absl::Status& not_found, Permission need);

  // What of others' a list shows to the caller; of cases one a name, and none that the caller has,
  // too.
  absl::StatusOr<std::set<std::string>> SharedSessions(const Principal& caller);
  absl::StatusOr<std::set<std::string>> SharedPredictions(const Principal& caller);
  absl::StatusOr<std::set<CaseKey>> SharedCases(const Principal& caller);

  // A link that is good: neither expired nor taken back, and its maker may still drag the session.
  // Errors: Unauthenticated.
  absl::StatusOr<FollowLinkRow> FindLink(const std::string& digest);
  // As RecheckSessionAccess. Errors: Unauthenticated.
  absl::Status RecheckLink(const std::string& digest);
  // Links that were good are asked for again: after this server has changed rights or sessions.
  void ForgetLinks();

  // What has no rights but its owner's and those of its project (build drafts). Errors:
  // `not_found`, PermissionDenied.
  absl::Status CheckProjectItemAccess(const Principal& caller, const ProjectKey& project,
                                      const absl::Status& not_found, Permission need);
  // The projects of others that are shared with the caller.
  absl::StatusOr<std::map<ProjectKey, ShareRole>> SharedProjects(const Principal& caller);

  // What is kept, by owner; a mesh is held by each of those who have sent it.
  absl::StatusOr<std::map<std::string, Holdings>> HoldingsByOwner();
  // Whether the caller may keep so many bytes more. Errors: ResourceExhausted (a quota).
  absl::Status CheckStorageQuota(const Principal& caller, int64_t bytes);
  // 0: as many as there is room for. Call it before anything else.
  void set_most_bytes(int64_t most) { most_bytes_ = most; }

 private:
  friend class AccessChanges;

  enum class Level { kNothing, kRead, kWrite, kOwner };
  using Time = std::chrono::steady_clock::time_point;

  static absl::Status Judge(Level level, Permission need, const absl::Status& not_found);
  static Level LevelOf(const std::string& owner, const std::optional<ShareRole>& role,
                       const Principal& caller);
  bool IsGood(const LinkGrant& link) const;
  absl::StatusOr<bool> HasGoodLink(const std::string& session);
  absl::StatusOr<Level> LinkLevel(const Principal& link, const std::string& session);
  // Unset: there is no such session.
  absl::StatusOr<std::optional<Level>> SessionLevel(const Principal& caller, const std::string& id);
  absl::StatusOr<std::optional<Level>> PredictionLevel(const Principal& caller,
                                                       const std::string& id);
  // Whether a planner who may read the case has made an exported prediction of it.
  absl::StatusOr<bool> IsExportedCase(const CaseKey& key);
  absl::StatusOr<CaseKey> FindCase(const Principal& caller, const std::string& sha256,
                                   Permission need);
  absl::StatusOr<CaseKey> CaseOfLink(const Principal& link, const std::string& sha256);
  absl::StatusOr<Level> MeshLevel(const Principal& caller, const std::string& sha256);
  absl::StatusOr<std::set<CaseKey>> ExportedCases();

  // Unavailable where the database has just not answered.
  absl::Status CheckAsked() ABSL_LOCKS_EXCLUDED(mutex_);
  template <typename Answer>
  absl::StatusOr<Answer> Noting(absl::StatusOr<Answer> answer) ABSL_LOCKS_EXCLUDED(mutex_);
  absl::StatusOr<std::optional<SessionGrant>> AskForSession(const Principal& caller,
                                                            const std::string& id)
      ABSL_LOCKS_EXCLUDED(mutex_);

  AccessQueries& queries_;
  const UnixClock clock_;
  const ExportQueue* const exports_;  // null: nothing is exported
  int64_t most_bytes_ = 0;            // of one principal

  Mutex mutex_;
  Time silent_until_ ABSL_GUARDED_BY(mutex_);
  std::optional<Time> away_since_ ABSL_GUARDED_BY(mutex_);  // unset: the database has answered last
  // What was answered last, by principal and session, and when.
  std::map<std::pair<std::string, std::string>, std::pair<SessionGrant, Time>> sessions_
      ABSL_GUARDED_BY(mutex_);
  std::map<std::string, std::pair<FollowLinkRow, Time>> links_ ABSL_GUARDED_BY(mutex_);
  int64_t links_forgotten_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace tissueform
