// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/builds/build_drafts.h"
#include "server/builds/build_files.h"
#include "server/builds/build_limits.h"
#include "server/builds/plan_builder.h"
#include "server/store/session_store.h"
#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

// The plans that a server builds, one after the other in the order of their creation, each a file
// and a folder of its own. Durable when Create has answered.
//
// A build that was under way when the server ended has failed when it starts again, and says so:
// its case is stored last, so none is left half. One that waited goes on waiting.
//
// Calls block on the disk. Thread-safe.
class PlanBuilds {
 public:
  // What builds: BuildPlanOf, or in a test what stands for it. Called on threads of this object.
  using Work = std::function<absl::StatusOr<BuiltPlan>(const PlanBuildJob& job)>;

  // Reads what the folder has, and makes a missing folder. `files` and `drafts` must
  // outlive it.
  static absl::StatusOr<std::unique_ptr<PlanBuilds>> Open(std::string folder,
                                                          const PlanBuildLimits& limits,
                                                          int threads, BuildFiles* files,
                                                          BuildDrafts* drafts, Work work,
                                                          UnixClock clock = SystemUnixSeconds);
  // Ends what is under way, which has failed then.
  ~PlanBuilds();
  PlanBuilds(const PlanBuilds&) = delete;
  PlanBuilds& operator=(const PlanBuilds&) = delete;

  const PlanBuildLimits& limits() const { return limits_; }

  // Errors: InvalidArgument (REQUEST_ID_REUSED), ResourceExhausted (a limit), NotFound or
  // FailedPrecondition (a file that is not there, or not whole), or what the disk says.
  absl::StatusOr<v1::PlanBuild> Create(const std::string& owner,
                                       const v1::CreatePlanBuildRequest& request);

  // Errors of all: NotFound, also where the build belongs to another user.
  absl::StatusOr<v1::PlanBuild> Find(const std::string& owner, const std::string& id) const;
  // One that waits has ended when it returns; one that runs ends soon, or is done first.
  absl::StatusOr<v1::PlanBuild> Cancel(const std::string& owner, const std::string& id);
  // Errors: FailedPrecondition (it is not done).
  absl::Status Remove(const std::string& owner, const std::string& id);
  // The file of what was made, one of PlanBuild.files.
  absl::StatusOr<std::string> PathOf(const std::string& owner, const std::string& id,
                                     const std::string& path) const;

  struct Page {
    std::vector<v1::PlanBuild> builds;  // by id, rising with the creation
    std::string next;                   // give it as `after`; empty: that was all
  };
  Page List(const std::string& owner, const std::string& after, int limit) const;

  // Not done.
  int CountOpen() const;

  // Removes a draft, and its CT unless a build or another draft needs that. Errors: NotFound,
  // FailedPrecondition (a plan is being built of it), or what the disk says.
  absl::Status RemoveDraft(const v1::BuildDraft& draft);

  // Removes builds, drafts and files whose time is over. The threads of this object call it, too.
  void RemoveExpired();

 private:
  struct Build;
  using BuildPtr = std::shared_ptr<Build>;
  // Counts toward its owner's limit of a day, also after its removal.
  struct Removed {
    std::string owner;
    int64_t create_s;
  };

  PlanBuilds(std::string folder, const PlanBuildLimits& limits, int threads, BuildFiles* files,
             BuildDrafts* drafts, Work work, UnixClock clock);

  absl::Status TakeUp();
  std::string FolderOf(const std::string& id) const;
  absl::Status Keep(const Build& build) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Also forgets what was created before that day.
  int CountRemovedToday(const std::string& owner) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckRoom(const std::string& owner) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The files of a request, all of which are there and whole.
  absl::StatusOr<std::vector<BuildFileRecord>> CheckFiles(
      const std::string& owner, const v1::CreatePlanBuildRequest& request) const;
  absl::StatusOr<BuildPtr> Known(const std::string& owner, const std::string& id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // As a client sees it.
  v1::PlanBuild Shown(const Build& build) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Whether a build of it is not done.
  bool IsDraftUsed(const std::string& draft) const ABSL_LOCKS_EXCLUDED(mutex_);
  // By a build that is not done, or a draft.
  bool IsNeeded(const std::string& owner, const std::string& sha256) const
      ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status RemoveBuild(const BuildPtr& build) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  void Serve();
  BuildPtr NextWaiting() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Run(const BuildPtr& build) ABSL_LOCKS_EXCLUDED(mutex_);
  void Finish(const BuildPtr& build, const absl::StatusOr<BuiltPlan>& plan)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void NoteCase(const std::string& draft, const std::string& case_sha256);
  void DropFiles(const Build& build) ABSL_LOCKS_EXCLUDED(mutex_);

  const std::string folder_;
  const PlanBuildLimits limits_;
  const int threads_;  // of each build
  BuildFiles* const files_;
  BuildDrafts* const drafts_;
  const Work work_;
  const UnixClock clock_;

  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::map<std::string, BuildPtr> builds_ ABSL_GUARDED_BY(mutex_);  // by id
  std::vector<Removed> removed_ ABSL_GUARDED_BY(mutex_);
  bool is_ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::vector<std::thread> workers_;
};

}  // namespace tissueform
