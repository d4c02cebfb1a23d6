// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_endings.h"

#include <optional>
#include <utility>

#include "spdlog/spdlog.h"

#include "server/session/session_maker.h"
#include "server/session/session_refusals.h"

namespace tissueform {
namespace {

// Where nobody waits for the end of a session.
void WarnIfLeftBehind(const absl::Status& status) {
  if (!status.ok()) spdlog::warn("a session's record stays behind: {}", status.ToString());
}

}  // namespace

SessionEndings::SessionEndings(const ServiceLimits& limits, SharedSessionTable* sessions,
                               SessionStore* store, MeshCatalog* catalog, const Clock* clock,
                               SessionObserver observer)
    : limits_(limits),
      sessions_(sessions),
      store_(store),
      catalog_(catalog),
      clock_(clock),
      observer_(std::move(observer)) {}

void SessionEndings::Abandon(const std::shared_ptr<Session>& session) {
  {
    MutexLock lock(sessions_->mutex);
    KnownSession* known = sessions_->table.Find(session->id());
    // Clients choose ids: another session may have it by now.
    if (known == nullptr || known->session != session || --known->claims > 0) return;
    sessions_->table.Take(session->id());
  }
  EndUnwanted(session);
}

void SessionEndings::Delete(const std::string& id, const StatusCallback& done) {
  std::optional<KnownSession> known;
  {
    MutexLock lock(sessions_->mutex);
    known = sessions_->table.Take(id);
  }
  if (!known.has_value()) {
    done(NoSuchSession(id));
  } else if (known->session == nullptr) {
    Forget(id, done);
  } else {
    End(known->session, done);
  }
}

void SessionEndings::EndUnwanted(const std::shared_ptr<Session>& session) {
  End(session, WarnIfLeftBehind);
}

void SessionEndings::End(const std::shared_ptr<Session>& session, const StatusCallback& done) {
  session->strand().Post(Lane::kSolves, [this, session, done] {
    session->Close(Session::CloseReason::kDeleted);
    // What is being made for it holds memory until that ends.
    const auto forget = [this, id = session->id(), done] { Forget(id, done); };
    if (session->making()) {
      session->making_strand().Post(Lane::kBatch, forget);
    } else {
      forget();
    }
  });
}

void SessionEndings::Forget(const std::string& id, StatusCallback done) {
  store_->Delete(id, "", kStoreEpoch,
                 [this, id, done = std::move(done)](const absl::Status& status) {
                   // Only now: who comes to watch after it shall not find the record any longer.
                   observer_(id, SessionEvent::kDeleted);
                   {
                     MutexLock lock(sessions_->mutex);
                     sessions_->table.Ended(id);
                   }
                   done(status);
                 });
}

int SessionEndings::Evict(const std::function<bool()>& enough,
                          const std::optional<std::string>& owner) {
  int count = 0;
  while (!enough()) {
    std::shared_ptr<Session> evicted;
    {
      MutexLock lock(sessions_->mutex);
      const std::string id = sessions_->table.LeastRecentlyUsed(clock_->Now() - kInUse, owner);
      if (id.empty()) break;
      KnownSession* known = sessions_->table.Find(id);
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
  if (count > 0) spdlog::info("{} sessions that were not in use have left memory", count);
  return count;
}

int SessionEndings::RemoveIdle() {
  std::vector<std::pair<std::string, KnownSession>> removed;
  {
    MutexLock lock(sessions_->mutex);
    for (const std::string& id :
         sessions_->table.UnusedSince(clock_->Now() - limits_.session_idle_ttl)) {
      removed.emplace_back(id, *sessions_->table.Take(id));
    }
  }
  const int count = static_cast<int>(removed.size());
  if (count > 0) {
    spdlog::info("removed {} sessions that were idle for more than {} s", count,
                 limits_.session_idle_ttl.count());
  }
  EndUnused(removed);
  return count;
}

int SessionEndings::RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since) {
  std::vector<std::pair<std::string, KnownSession>> removed;
  {
    MutexLock lock(sessions_->mutex);
    SessionTable& table = sessions_->table;
    for (const std::string& id : ids) {
      if (table.Find(id) != nullptr && !table.IsInUse(id, since)) {
        removed.emplace_back(id, *table.Take(id));
      }
    }
  }
  const int count = static_cast<int>(removed.size());
  EndUnused(removed);
  return count;
}

void SessionEndings::EndUnused(const std::vector<std::pair<std::string, KnownSession>>& removed) {
  for (const auto& [id, known] : removed) {
    if (known.session != nullptr) known.session->Close(Session::CloseReason::kDeleted);
    Forget(id, WarnIfLeftBehind);
  }
}

absl::Status SessionEndings::RemoveMesh(const std::string& sha256) {
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
