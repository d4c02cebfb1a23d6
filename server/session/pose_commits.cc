// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/pose_commits.h"

#include <utility>

#include "absl/status/status.h"

#include "core/base/error_reason.h"
#include "server/session/session_maker.h"

namespace tissueform {

void PoseCommits::Commit(std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
                         SessionStore::StatusCallback done) {
  MutexLock lock(mutex_);
  const std::string& id = session->id();
  if (const auto held = held_.find(id); held != held_.end()) {
    held->second.commits.push_back([this, session = std::move(session), poses = std::move(poses),
                                    done = std::move(done)]() mutable {
      Commit(std::move(session), std::move(poses), std::move(done));
    });
  } else if (session->outdated()) {
    done(WithReason(absl::AbortedError("the session has other handles now; open the stream again"),
                    ErrorReason::kSessionUpdated));
  } else {
    store_->CommitPoses(id, std::move(poses), kStoreEpoch, std::move(done));
  }
}

void PoseCommits::Hold(const std::string& id) {
  MutexLock lock(mutex_);
  ++held_[id].holders;
}

void PoseCommits::Release(const std::string& id) {
  std::vector<std::function<void()>> commits;
  {
    MutexLock lock(mutex_);
    const auto held = held_.find(id);
    if (--held->second.holders > 0) return;
    commits = std::move(held->second.commits);
    held_.erase(held);
  }
  for (const std::function<void()>& commit : commits) commit();
}

}  // namespace tissueform
