// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_table.h"
#include "server/store/session_store.h"

namespace tissueform {

// What happens to a session, for those who follow it without using it.
enum class SessionEvent { kEvicted, kRestored, kDeleted };
// From any thread, without a lock held.
using SessionObserver = std::function<void(const std::string& id, SessionEvent event)>;

// How sessions leave: out of memory only, or with their records and for good; and how a mesh goes
// that no session needs any longer.
//
// Thread-safe.
class SessionEndings {
 public:
  using StatusCallback = std::function<void(absl::Status)>;

  // What was used within this time is not evicted: a server that would take sessions from those who
  // work with them refuses instead.
  static constexpr std::chrono::seconds kInUse{10};

  // All pointers must outlive it and what it ends.
  SessionEndings(const ServiceLimits& limits, SharedSessionTable* sessions, SessionStore* store,
                 MeshCatalog* catalog, const Clock* clock, SessionObserver observer);

  // See SessionRegistry.
  void Abandon(const std::shared_ptr<Session>& session) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void Delete(const std::string& id, const StatusCallback& done)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int Evict(const std::function<bool()>& enough, const std::optional<std::string>& owner = {})
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int RemoveIdle() ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  absl::Status RemoveMesh(const std::string& sha256) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // Ends a session that is out of the table, and its record; where nobody waits for that.
  void EndUnwanted(const std::shared_ptr<Session>& session);

 private:
  void End(const std::shared_ptr<Session>& session, const StatusCallback& done);
  // Takes the record of a session that has ended out of the store; then its id is free again.
  void Forget(const std::string& id, StatusCallback done);
  void EndUnused(const std::vector<std::pair<std::string, KnownSession>>& removed);

  const ServiceLimits limits_;
  SharedSessionTable* const sessions_;
  SessionStore* const store_;
  MeshCatalog* const catalog_;
  const Clock* const clock_;
  const SessionObserver observer_;
};

}  // namespace tissueform
