// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_evictor.h"

#include <optional>
#include <utility>

#include "spdlog/spdlog.h"

#include "server/session/session_errors.h"

namespace tissueform {
namespace {

// Where nobody waits for the end of a session.
void WarnIfLeftBehind(const absl::Status& status) {
  if (!status.ok()) spdlog::warn("a session's record remains: {}", status.ToString());
}

}  // namespace

SessionEvictor::SessionEvictor(const ServiceLimits& limits, SharedSessionTable* sessions,
                               SessionStore* store, MeshCatalog* catalog, SessionLeaseTable* holds,
                               const Clock* clock, SessionObserver observer)
    : limits_(limits),
      sessions_(sessions),
      store_(store),
      catalog_(catalog),
      holds_(holds),
      clock_(clock),
      observer_(std::move(observer)) {}

void SessionEvictor::Abandon(const std::shared_ptr<Session>& session) {
  {
    MutexLock lock(sessions_->mutex);
    SessionEntry* known = sessions_->table.Find(session->id());
    // Clients choose ids: another session may have it by now.
    if (known == nullptr || known->session != session || --known->claims > 0) return;
    sessions_->table.Take(session->id());
  }
  EndUnwanted(session);
}

void SessionEvictor::Delete(const std::string& id, const StatusCallback& done) {
  holds_->Take(id, [this, id, done](const absl::StatusOr<SessionLeaseHandlePtr>& hold) {
    if (hold.ok()) {
      DeleteHeld(id, *hold, done);
    } else if (absl::IsNotFound(hold.status())) {
      Gone(id);
      done(NoSuchSession(id));
    } else {
      done(hold.status());
    }
  });
}

void SessionEvictor::DeleteHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                                const StatusCallback& done) {
  std::optional<SessionEntry> known;
  {
    MutexLock lock(sessions_->mutex);
    known = sessions_->table.Take(id);
  }
  if (!known.has_value()) {
    done(NoSuchSession(id));
  } else if (known->session == nullptr) {
    Forget(id, hold, done);
  } else {
    End(known->session, [this, id, hold, done] { Forget(id, hold, done); });
  }
}

void SessionEvictor::EndUnwanted(const std::shared_ptr<Session>& session) {
  const SessionLeaseHandlePtr hold = session->hold();
  // Also where this server could not have its lease, or has it no longer: the database may just be
  // there again, and whoever has asked for the session may have made and deleted it elsewhere
  // meanwhile. Of one that another server has taken since the store keeps the record.
  End(session, [this, id = session->id(), hold] { Erase(id, hold, WarnIfLeftBehind); });
}

void SessionEvictor::End(const std::shared_ptr<Session>& session,
                         const std::function<void()>& then) {
  session->strand().Post(Lane::kSolves, [session, then] {
    session->Close(Session::CloseReason::kDeleted);
    // What is being made for it holds memory until that ends.
    if (session->making()) {
      session->making_strand().Post(Lane::kBatch, then);
    } else {
      then();
    }
  });
}

void SessionEvictor::Forget(const std::string& id, const SessionLeaseHandlePtr& hold,
                            const StatusCallback& done) {
  if (const absl::Status held = CheckHold(hold); held.ok()) {
    Erase(id, hold, done);
  } else {
    Erased(id, hold, held, done);
  }
}

void SessionEvictor::Erase(const std::string& id, const SessionLeaseHandlePtr& hold,
                           const StatusCallback& done) {
  store_->Delete(id, "", EpochUnder(hold), [this, id, hold, done](const absl::Status& outcome) {
    Erased(id, hold, outcome, done);
  });
}

void SessionEvictor::Erased(const std::string& id, const SessionLeaseHandlePtr& hold,
                            const absl::Status& outcome, const StatusCallback& done) {
  const absl::Status status = hold == nullptr ? outcome : MovedIfFenced(outcome);
  // Only now: who comes to watch after it shall not find the record any longer. One of a store
  // that is shared, whose record is still there, is found by whoever asks for it next.
  const bool is_kept = hold != nullptr && !status.ok() && !absl::IsNotFound(status);
  observer_(id, is_kept ? SessionEvent::kMoved : SessionEvent::kDeleted);
  // Before its id is free: the lease of this one says nothing of the next.
  if (hold != nullptr && !is_kept) holds_->Forget(id);
  {
    MutexLock lock(sessions_->mutex);
    sessions_->table.Ended(id);
  }
  done(status);
}

void SessionEvictor::Lost(const std::string& id) {
  std::shared_ptr<Session> lost;
  {
    MutexLock lock(sessions_->mutex);
    SessionEntry* known = sessions_->table.Find(id);
    if (known != nullptr && known->session != nullptr) {
      if (known->session->CheckHeld().ok()) return;  // taken anew, and made since
      lost = std::exchange(known->session, nullptr);
      known->last_used = lost->last_used();
      if (!catalog_->keeps_meshes()) known->mesh = lost->shared_mesh();
    }
  }
  if (lost == nullptr && holds_->Holds(id)) return;
  if (lost != nullptr) lost->Close(Session::CloseReason::kMoved);
  observer_(id, SessionEvent::kMoved);
}

void SessionEvictor::Gone(const std::string& id) {
  if (holds_->Holds(id)) return;
  std::optional<SessionEntry> known;
  {
    MutexLock lock(sessions_->mutex);
    if (sessions_->table.FindMaking(id) != nullptr) return;
    known = sessions_->table.Take(id);
    if (known.has_value()) sessions_->table.Ended(id);
  }
  if (!known.has_value()) return;
  if (known->session != nullptr) known->session->Close(Session::CloseReason::kDeleted);
  observer_(id, SessionEvent::kDeleted);
}

int SessionEvictor::Evict(const std::function<bool()>& enough,
                          const std::optional<std::string>& owner) {
  int count = 0;
  while (!enough()) {
    std::shared_ptr<Session> evicted;
    {
      MutexLock lock(sessions_->mutex);
      const std::string id = sessions_->table.LeastRecentlyUsed(clock_->Now() - kInUse, owner);
      if (id.empty()) break;
      SessionEntry* known = sessions_->table.Find(id);
      evicted = std::move(known->session);
      known->last_used = evicted->last_used();
      std::erase_if(known->evicted, [](const auto& earlier) { return earlier.expired(); });
      known->evicted.push_back(evicted);
      if (!catalog_->keeps_meshes()) known->mesh = evicted->shared_mesh();
    }
    observer_(evicted->id(), SessionEvent::kEvicted);
    // Here and now, whoever still holds it: nothing is being solved in a session not in use.
    evicted->Close(Session::CloseReason::kEvicted);
    ++count;
  }
  if (count > 0) spdlog::info("{} unused sessions were evicted from memory", count);
  return count;
}

int64_t SessionEvictor::EvictableBytes() const {
  MutexLock lock(sessions_->mutex);
  return sessions_->table.BytesUnusedSince(clock_->Now() - kInUse);
}

int SessionEvictor::RemoveIdle() {
  const Clock::TimePoint until = clock_->Now() - limits_.session_idle_ttl;
  std::vector<std::string> ids;
  {
    MutexLock lock(sessions_->mutex);
    ids = sessions_->table.UnusedSince(until);
  }
  const std::vector<Removed> removed =
      TakeUnused(ids, [until](const SessionTable& table, const std::string& id) {
        return table.IsUnusedSince(id, until);
      });
  const int count = static_cast<int>(removed.size());
  if (count > 0) {
    spdlog::info("removed {} sessions that were idle for more than {} s", count,
                 limits_.session_idle_ttl.count());
  }
  EndUnused(removed);
  return count;
}

int SessionEvictor::RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since) {
  const std::vector<Removed> removed =
      TakeUnused(ids, [since](const SessionTable& table, const std::string& id) {
        return table.Find(id) != nullptr && !table.IsInUse(id, since);
      });
  const int count = static_cast<int>(removed.size());
  EndUnused(removed);
  return count;
}

std::vector<SessionEvictor::Removed> SessionEvictor::TakeUnused(
    const std::vector<std::string>& ids,
    const std::function<bool(const SessionTable& table, const std::string& id)>& is_unused) {
  std::vector<Removed> removed;
  for (const std::string& id : ids) {
    {
      MutexLock lock(sessions_->mutex);
      if (!is_unused(sessions_->table, id)) continue;
    }
    absl::StatusOr<SessionLeaseHandlePtr> hold = holds_->TakeAndWait(id);
    if (!hold.ok()) continue;  // another server may use it
    MutexLock lock(sessions_->mutex);
    if (!is_unused(sessions_->table, id)) continue;
    removed.push_back({id, *sessions_->table.Take(id), *std::move(hold)});
  }
  return removed;
}

void SessionEvictor::EndUnused(const std::vector<Removed>& removed) {
  for (const auto& [id, known, hold] : removed) {
    if (known.session != nullptr) known.session->Close(Session::CloseReason::kDeleted);
    Forget(id, hold, WarnIfLeftBehind);
  }
}

absl::Status SessionEvictor::RemoveMesh(const std::string& sha256) {
  // Sessions in memory keep what nobody could read again.
  if (!catalog_->keeps_meshes()) return catalog_->Remove(sha256);
  {
    MutexLock lock(sessions_->mutex);
    const int sessions = sessions_->table.CountMadeFrom(sha256);
    if (sessions > 0) return MeshInUse(sessions);
    sessions_->table.BeginRemoval(sha256);
  }
  absl::Status removed = catalog_->Remove(sha256);
  MutexLock lock(sessions_->mutex);
  sessions_->table.EndRemoval(sha256);
  return removed;
}

}  // namespace tissueform
