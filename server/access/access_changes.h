// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/access.h"
#include "server/access/access_options.h"
#include "server/store/access_store.h"

namespace tissueform {

// What changes who may do what: shares, follow links, who has sent a mesh, and what there is.
//
// What is taken away is away in memory at once, and durable when `done`; what is given counts from
// then on. `done` is called once, on any thread; it may not block. Thread-safe.
class AccessChanges {
 public:
  using Done = std::function<void(absl::Status)>;

  // Both must outlive it.
  AccessChanges(const AccessOptions& options, AccessStore* store, Access* access)
      : options_(options), store_(store), access_(*access) {}

  const AccessOptions& options() const { return options_; }
  const Access& access() const { return access_; }

  // Reads what the store has. Call it before anything else; blocks. Errors: those of
  // AccessStore::Load.
  absl::Status LoadAll();

  // Where others write to the store as well. Before anything else: from now on changes that are
  // under way are not undone by what ReloadRows has read before them.
  void EnableClusterMode() { follows_ = true; }
  // Takes what the store has in place of what was known. Blocks. Errors: those of
  // AccessStore::Load.
  absl::Status ReloadRows();
  // What others have deleted: their rows go by ReloadRows. What is known of a session's rows is
  // erased from the store, too: who deleted it may not have known all, and the next session of its
  // name is another's.
  void SessionGone(const std::string& id);
  void PredictionGone(const std::string& id);
  void CaseGone(const CaseKey& key);
  // All that is known.
  struct Known {
    std::vector<std::string> sessions = {};
    std::vector<std::string> predictions = {};
    std::vector<CaseKey> cases = {};
  };
  Known AllKnown() const;

  // Shares a resource of the caller's own; again: with this role. Shares of a project may come
  // before the project.
  //
  // Errors: InvalidArgument (the names), NotFound, PermissionDenied, ResourceExhausted.
  void Share(const Principal& caller, ShareRow share, const Done& done);
  // Errors: those of Share; NotFound: no such share.
  void Unshare(const Principal& caller, const std::string& resource, const std::string& with,
               const Done& done);
  absl::StatusOr<std::vector<ShareRow>> SharesOf(const Principal& caller,
                                                 const std::string& resource) const;

  // Keeps a follow link of the caller's making. Errors: those of Access::CheckSessionAccess
  // (kWrite) and CheckCaseAccess; ResourceExhausted.
  void AddLink(const Principal& caller, FollowLinkRow link, const Done& done);
  // All of the session. Errors: those of Access::CheckSessionAccess (kWrite).
  void RemoveLinks(const Principal& caller, const std::string& session, const Done& done);

  // The caller has sent the bytes of the mesh, and wants it no more. Both block on the disk.
  absl::Status GrantMesh(const Principal& caller, const std::string& sha256, int64_t bytes);
  absl::Status ReleaseMesh(const Principal& caller, const std::string& sha256);

  // What there is has changed. Removed resources take their shares and links with them.
  template <typename Record>
  void Added(const Record& record) {
    MutexLock lock(access_.mutex_);
    access_.index_.Add(record);
  }
  void SessionRemoved(const std::string& id);
  void PredictionRemoved(const std::string& id);
  void CaseRemoved(const CaseKey& key);
  void MeshRemoved(const std::string& sha256);

 private:
  absl::Status MayOwn(const Principal& caller, const std::string& resource) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(access_.mutex_);
  absl::Status CheckShare(const Principal& caller, const ShareRow& share) const
      ABSL_LOCKS_EXCLUDED(access_.mutex_);
  absl::Status CheckLink(const Principal& caller, const FollowLinkRow& link) const
      ABSL_LOCKS_EXCLUDED(access_.mutex_);

  // Has it looked for where nobody here knows it.
  absl::Status FetchIfMissing(const Principal& caller, absl::string_view resource) const
      ABSL_LOCKS_EXCLUDED(access_.mutex_);

  // From memory at once, then from the store.
  void Erase(AccessRows rows, const Done& done) ABSL_LOCKS_EXCLUDED(access_.mutex_);
  // Into the store, then into memory.
  void Put(AccessRows rows, const Done& done) ABSL_LOCKS_EXCLUDED(access_.mutex_);

  // A change of this server's that a Load under way may not have seen.
  struct Unseen {
    AccessRows erased = {};
    AccessRows put = {};
    bool ended = false;
    bool kept = false;
  };
  std::shared_ptr<Unseen> Begin(AccessRows erased, AccessRows put)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(access_.mutex_);
  void End(Unseen* unseen, bool kept) ABSL_LOCKS_EXCLUDED(access_.mutex_);

  // Constant.
  const AccessOptions options_;
  AccessStore* const store_;
  bool follows_ = false;  // constant once calls are served
  Access& access_;

  Mutex learning_;                                                               // over ReloadRows
  std::vector<std::shared_ptr<Unseen>> unseen_ ABSL_GUARDED_BY(access_.mutex_);  // in their order
};

}  // namespace tissueform
