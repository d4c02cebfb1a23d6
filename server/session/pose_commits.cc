// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/pose_commits.h"

#include <utility>

#include "absl/status/status.h"

#include "core/base/error_reason.h"
#include "server/session/session_errors.h"

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
  } else if (absl::Status may_write = session->CheckHeld(); !may_write.ok()) {
    done(std::move(may_write));
  } else if (session->hold() == nullptr) {
    store_->CommitPoses(id, std::move(poses), session->epoch(), std::move(done));
  } else {
    Send(id, std::move(poses), session->epoch(), std::move(done));
  }
}

void PoseCommits::Send(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                       SessionStore::StatusCallback done) {
  {
    MutexLock lock(under_way_mutex_);
    ++under_way_[id];
  }
  store_->CommitPoses(id, std::move(poses), epoch,
                      [this, id, done = std::move(done)](absl::Status status) {
                        done(MovedIfFenced(std::move(status)));
                        EndOne(id);
                      });
}

void PoseCommits::EndOne(const std::string& id) {
  MutexLock lock(under_way_mutex_);
  if (--under_way_[id] == 0) under_way_.erase(id);
  fewer_.NotifyAll();
}

void PoseCommits::WaitFor(const std::string& id, std::chrono::steady_clock::time_point deadline) {
  MutexLock lock(under_way_mutex_);
  while (under_way_.contains(id) && fewer_.WaitUntil(under_way_mutex_, deadline)) {
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
