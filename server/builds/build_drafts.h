// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/builds/build_files.h"
#include "server/builds/build_limits.h"
#include "server/store/session_store.h"
#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

// NotFound.
absl::Status NoBuildDraft(const std::string& id);

// CTs that wait for a person who builds a plan of them, each a record of its own; the CT is a file
// of BuildFiles. Durable when Create and AddCase have answered. Who may do what with a draft is for
// the caller to decide: by `principal` and `project`.
//
// Calls block on the disk. Thread-safe.
class BuildDrafts {
 public:
  // Reads what the folder has, and makes a missing folder. `files` must outlive it.
  static absl::StatusOr<std::unique_ptr<BuildDrafts>> Open(std::string folder,
                                                           const PlanBuildLimits& limits,
                                                           BuildFiles* files,
                                                           UnixClock clock = SystemUnixSeconds);
  BuildDrafts(const BuildDrafts&) = delete;
  BuildDrafts& operator=(const BuildDrafts&) = delete;

  // The same again returns the draft that is there, unless a case was built of it.
  // Errors: NotFound or FailedPrecondition (the file is not there, or not whole), ResourceExhausted
  // (a limit), or what the disk says.
  absl::StatusOr<v1::BuildDraft> Create(const std::string& owner,
                                        const v1::CreateBuildDraftRequest& request);
  absl::StatusOr<v1::BuildDraft> Find(const std::string& id) const;  // NotFound
  // By id, which rises with the creation.
  std::vector<v1::BuildDraft> List() const;
  // Notes a case that was built of it. Errors: NotFound, or what the disk says.
  absl::Status AddCase(const std::string& id, const std::string& case_name);
  // Its file stays: IsNeeded says whether that may go. Errors: NotFound, or what the disk says.
  absl::Status Remove(const std::string& id);

  // Whether the owner's file is the CT of a draft whose time is not over.
  bool IsNeeded(const std::string& owner, const std::string& sha256) const;
  // Removes drafts whose time is over, but those that `is_used` names. A draft with cases stays
  // for 30 days more, without its CT: its creator may have been away.
  void RemoveExpired(const std::function<bool(const std::string& name)>& is_used);

 private:
  struct Draft {
    v1::BuildDraft proto = {};
    int64_t built_s = 0;  // 0: no case
  };

  BuildDrafts(std::string folder, const PlanBuildLimits& limits, BuildFiles* files,
              UnixClock clock);

  absl::Status TakeUp();
  std::string PathOf(const std::string& id) const;
  absl::Status Keep(const std::string& id, const Draft& draft) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::string NewId() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int64_t ExpiresS(const Draft& draft) const;
  // As a client sees it.
  v1::BuildDraft Shown(const Draft& draft) const;

  const std::string folder_;
  const PlanBuildLimits limits_;
  BuildFiles* const files_;
  const UnixClock clock_;

  mutable Mutex mutex_;
  std::map<std::string, Draft> drafts_ ABSL_GUARDED_BY(mutex_);  // by id
};

}  // namespace tissueform
