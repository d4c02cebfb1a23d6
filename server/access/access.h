// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/auth/identity.h"
#include "server/access/resource_index.h"
#include "server/access/row_reader.h"
#include "server/access/share_table.h"
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

// Who may do what: the one place that decides it (docs/security.md, "Permissions").
//
// Checks of one resource are answered from memory, by one look-up with principal and name, and
// never block. Lists and sums ask the store, and block. What a
// principal may not look at answers NotFound, as what is not there, to the letter;
// PermissionDenied is for what may be looked at only. What nobody with a name owns is open to those
// without a name, and to them alone.
//
// Where several servers use one store, another may have made a moment ago what is not known here.
// Then, and only then, the store is asked for that one row (set_row_reader), which may take a
// while.
//
// Thread-safe. Its lock is held over nothing but the look-ups in the exports.
class Access {
 public:
  // Both must outlive it. `exports` says what is to go to the PACS; null: nothing is.
  explicit Access(AccessQueries* queries, UnixClock clock = SystemUnixSeconds,
                  const ExportQueue* exports = nullptr)
      : queries_(*queries), clock_(std::move(clock)), exports_(exports) {}

  // Where several servers use one store: asked for what a call names and is not known here, on the
  // call's thread. It must outlive the calls. Call it before calls are served.
  void set_row_reader(RowReader* reader) { reader_ = reader; }

  // Whether the principal may call a method ("CaseService.UploadCase") at all: publishers publish,
  // and a follow link follows. Errors: PermissionDenied.
  static absl::Status CheckMethodAccess(const Principal& caller, std::string_view method);
  // Whether new resources may go into the project; empty: none. Errors: InvalidArgument,
  // PermissionDenied.
  static absl::Status CheckProjectAccess(const Principal& caller, const std::string& project);

  // Errors: NotFound, PermissionDenied; Unauthenticated for a follow link that has ended.
  absl::Status CheckSessionAccess(const Principal& caller, const std::string& id,
                                  Permission need) const;
  // As CheckSessionAccess, for a call that lasts and was allowed when it began. Never blocks, not
  // even where several servers use one store. OK for a session that is gone: what uses it ends with
  // the reason for that.
  absl::Status RecheckSessionAccess(const Principal& caller, const std::string& id,
                                    Permission need) const;
  absl::Status CheckPredictionAccess(const Principal& caller, const std::string& id,
                                     Permission need) const;
  // Whose case the caller's name of it means: its own, else the first that it may look at.
  absl::StatusOr<CaseKey> CheckCaseAccess(const Principal& caller, const std::string& sha256,
                                          Permission need) const;
  // A mesh is looked at, and sessions are made of it, by who has sent its bytes and who may look at
  // a session or a prediction that holds it; who has sent its bytes owns it. Errors: NotFound,
  // PermissionDenied.
  absl::Status CheckMeshAccess(const Principal& caller, const std::string& sha256,
                               Permission need) const;
  // Whether somebody else has sent its bytes, or has a session of it.
  bool OthersHoldMesh(const Principal& caller, const std::string& sha256) const;
  // How many sessions of the caller are made from it.
  int CountSessionsOf(const Principal& caller, const std::string& mesh) const;

  // Whose exports the caller sees: its own; unset: all, as bridges do.
  static std::optional<std::string> ExportsSeenBy(const Principal& caller);
  // An export that is the owner's. Errors: NotFound, PermissionDenied.
  static absl::Status CheckExportAccess(const Principal& caller, const std::string& owner,
                                        const absl::Status& not_found, Permission need);

  // What of others' a list shows to the caller; of cases one a name, and none that the caller has,
  // too. Block. Errors: those of AccessQueries.
  absl::StatusOr<std::set<std::string>> SharedSessions(const Principal& caller) const;
  absl::StatusOr<std::set<std::string>> SharedPredictions(const Principal& caller) const;
  absl::StatusOr<std::set<CaseKey>> SharedCases(const Principal& caller) const;

  // A link that is good: neither expired nor taken back, and its maker may still drag the session.
  // Errors: Unauthenticated.
  absl::StatusOr<FollowLinkRow> FindLink(const std::string& digest) const;
  // Whether a link that was found is still good. Never blocks, not even where several servers use
  // one store. Errors: Unauthenticated.
  absl::Status RecheckLink(const std::string& digest) const;

  // What is kept, by owner; a mesh is held by each of those who have sent it. Blocks. Errors: those
  // of AccessQueries.
  absl::StatusOr<std::map<std::string, Holdings>> HoldingsByOwner() const;
  // Whether the caller may keep so many bytes more. Blocks. Errors: ResourceExhausted (a quota),
  // those of AccessQueries.
  absl::Status CheckStorageQuota(const Principal& caller, int64_t bytes) const;
  // 0: as many as there is room for. Call it before anything else.
  void set_most_bytes(int64_t most) { most_bytes_ = most; }
  // Whether there is such a one: what is asked for without a name may be anything.
  bool KnowsSession(const std::string& id) const;
  bool KnowsPrediction(const std::string& id) const;
  // Empty where nobody with a name has it.
  std::string OwnerOf(const std::string& session) const;

 private:
  friend class AccessChanges;

  enum class Level { kNothing, kRead, kWrite, kOwner };

  static absl::Status Judge(Level level, Permission need, const absl::Status& not_found);
  // All with the lock.
  absl::Status JudgeSession(const Principal& caller, const std::string& id, Permission need) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Level LevelOfShare(const std::string& owner, const std::string& resource,
                     const std::string& project, const std::string& principal) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Level SessionLevel(const Principal& caller, const std::string& id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Level PredictionLevel(const Principal& caller, const std::string& id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Whether a bridge may look at the case for a prediction of somebody who may.
  bool IsExportedCase(const CaseKey& key) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Level CaseLevel(const Principal& caller, const CaseKey& key) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Level MeshLevel(const Principal& caller, const std::string& sha256) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<CaseKey> FindCase(const Principal& caller, const std::string& sha256,
                                   Permission need) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<CaseKey> CaseOfLink(const Principal& link, const std::string& sha256) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<FollowLinkRow> GoodLink(const std::string& digest) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool IsGood(const FollowLinkRow& link) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool HasGoodLink(const std::string& session) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Reads it from the store where it is not known. Errors: those of RowReader.
  absl::Status FetchIfMissing(RowName::Kind kind, const std::string& name,
                              const std::string& owner = {}) const ABSL_LOCKS_EXCLUDED(mutex_);
  bool Knows(const RowName& row) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Cases of exported predictions that a bridge may look at.
  absl::StatusOr<std::set<CaseKey>> ExportedCases() const;

  AccessQueries& queries_;
  const UnixClock clock_;
  const ExportQueue* const exports_;  // null: nothing is exported
  int64_t most_bytes_ = 0;            // of one principal
  RowReader* reader_ = nullptr;       // null: all that there is is known

  mutable Mutex mutex_;
  // Mutable: a check adds what it has read from the store.
  mutable ResourceIndex index_ ABSL_GUARDED_BY(mutex_);
  mutable ShareTable table_ ABSL_GUARDED_BY(mutex_);
  // Read one by one since AccessChanges::ReloadRows has begun for the last time: what it has read
  // by then may lack them.
  mutable AccessRows fetched_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
