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
#include "server/session/session_lease_table.h"
#include "server/session/session_table.h"
#include "server/store/session_store.h"

namespace tissueform {

// What happens to a session, for those who follow it without using it.
// kMoved: this server holds it no longer.
enum class SessionEvent { kEvicted, kRestored, kDeleted, kMoved };
// From any thread, without a lock held.
using SessionObserver = std::function<void(const std::string& id, SessionEvent event)>;

// How sessions leave: out of memory only, or with their records and for good; and how a mesh goes
// that no session needs any longer.
//
// Thread-safe.
class SessionEvictor {
 public:
  using StatusCallback = std::function<void(absl::Status)>;

  // What was used within this time is not evicted: a server that would take sessions from those who
  // work with them refuses instead.
  static constexpr std::chrono::seconds kInUse{10};

  // All pointers must outlive it and what it ends.
  SessionEvictor(const ServiceLimits& limits, SharedSessionTable* sessions, SessionStore* store,
                 MeshCatalog* catalog, SessionLeaseTable* holds, const Clock* clock,
                 SessionObserver observer);

  // See SessionRegistry.
  void Abandon(const std::shared_ptr<Session>& session) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void Delete(const std::string& id, const StatusCallback& done)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int Evict(const std::function<bool()>& enough, const std::optional<std::string>& owner = {})
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int64_t EvictableBytes() const ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int RemoveIdle() ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  int RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  absl::Status RemoveMesh(const std::string& sha256) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void Lost(const std::string& id) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  // Its record is gone from the store; nothing where this server holds it or makes it.
  void Gone(const std::string& id) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // Ends a session that is out of the table, and its record; where nobody waits for that.
  void EndUnwanted(const std::shared_ptr<Session>& session);

 private:
  // Of one that is out of the table.
  struct Removed {
    std::string id;
    SessionEntry known;
    SessionLeaseHandlePtr hold;
  };

  void DeleteHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                  const StatusCallback& done) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  // Frees its memory, which may have to wait; then the rest.
  void End(const std::shared_ptr<Session>& session, const std::function<void()>& then);
  // Takes the record of a session that has ended out of the store; then its id is free again.
  // Forget, where this server still holds it; Erase, where no other server has taken it since.
  void Forget(const std::string& id, const SessionLeaseHandlePtr& hold, const StatusCallback& done);
  void Erase(const std::string& id, const SessionLeaseHandlePtr& hold, const StatusCallback& done);
  void Erased(const std::string& id, const SessionLeaseHandlePtr& hold, const absl::Status& outcome,
              const StatusCallback& done);
  // What nobody used since then, of these; of a store that is shared what can be taken.
  std::vector<Removed> TakeUnused(
      const std::vector<std::string>& ids,
      const std::function<bool(const SessionTable& table, const std::string& id)>& is_unused)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void EndUnused(const std::vector<Removed>& removed);

  const ServiceLimits limits_;
  SharedSessionTable* const sessions_;
  SessionStore* const store_;
  MeshCatalog* const catalog_;
  SessionLeaseTable* const holds_;
  const Clock* const clock_;
  const SessionObserver observer_;
};

}  // namespace tissueform
