// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/mutex.h"
#include "server/session/session.h"
#include "server/store/session_store.h"

namespace tissueform {

// Hands committed poses to the store, each before an update of its session or after it: never
// between its reading and its writing, where it would be lost.
//
// Thread-safe.
class PoseCommits {
 public:
  // `store` must outlive it.
  explicit PoseCommits(SessionStore* store) : store_(store) {}

  // Keeps the poses, one for every handle of `session`, as its last ones. `done` comes once, from
  // this thread or another, and calls nothing of this object. Errors: Aborted (the session has
  // other handles now), Unavailable (SESSION_MOVED), those of SessionStore::CommitPoses.
  void Commit(std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
              SessionStore::StatusCallback done) ABSL_LOCKS_EXCLUDED(mutex_);

  // What was handed to the store before is before what the caller hands to it next; what comes
  // later waits for as many calls of Release.
  void Hold(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void Release(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);

  // Until the store has answered all commits of a session that it shares with others, or then.
  void WaitFor(const std::string& id, std::chrono::steady_clock::time_point deadline)
      ABSL_LOCKS_EXCLUDED(under_way_mutex_);

 private:
  // To a store that is shared.
  void Send(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
            SessionStore::StatusCallback done) ABSL_LOCKS_EXCLUDED(under_way_mutex_);
  void EndOne(const std::string& id) ABSL_LOCKS_EXCLUDED(under_way_mutex_);

  struct Waiting {
    int holders = 0;
    std::vector<std::function<void()>> commits;
  };

  SessionStore* const store_;

  // Held while a commit is handed to the store.
  Mutex mutex_;
  std::map<std::string, Waiting> held_ ABSL_GUARDED_BY(mutex_);

  Mutex under_way_mutex_;  // innermost
  ConditionVariable fewer_;
  std::map<std::string, int> under_way_ ABSL_GUARDED_BY(under_way_mutex_);
};

}  // namespace tissueform
