// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_registry.h"

#include <algorithm>
#include <future>
#include <utility>

#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/auth/identity.h"
#include "server/session/session_refusals.h"

namespace tissueform {
namespace {

constexpr int kPageSize = 1000;

// Where nobody waits for the end of a session.
void WarnIfLeftBehind(const absl::Status& status) {
  if (!status.ok()) spdlog::warn("a session's record stays behind: {}", status.ToString());
}

absl::StatusOr<SessionStore::Page> ListAndWait(SessionStore* store,
                                               const SessionStore::ListRequest& request) {
  std::promise<absl::StatusOr<SessionStore::Page>> answer;
  store->List(request, [&answer](absl::StatusOr<SessionStore::Page> page) {
    answer.set_value(std::move(page));
  });
  return answer.get_future().get();
}

}  // namespace

SessionRegistry::SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget,
                                 WorkerPool* pool, SessionStore* store, MeshCatalog* catalog,
                                 const Clock* clock)
    : limits_(limits),
      pool_(pool),
      store_(store),
      catalog_(catalog),
      clock_(clock),
      maker_(budget, pool, store, catalog, clock),
      commits_(store),
      updates_(&maker_, store, &commits_,
               [this](const SessionMaker::Made& remade, bool other_handles) {
                 return Replace(remade, other_handles);
               }) {}

absl::Status SessionRegistry::LearnKnown() {
  SessionStore::ListRequest request{.owner = std::nullopt, .after = "", .limit = kPageSize};
  do {
    TF_ASSIGN_OR_RETURN(SessionStore::Page page, ListAndWait(store_, request));
    MutexLock lock(mutex_);
    for (SessionRecord& record : page.records) {
      KnownSession known;
      known.key = {std::move(record.request_id), std::move(record.request_fingerprint)};
      known.mesh_sha256 = std::move(record.mesh_sha256);
      known.last_used = clock_->Now();
      table_.Add(record.id, std::move(known));
    }
    request.after = std::move(page.next);
  } while (!request.after.empty());
  return absl::OkStatus();
}

void SessionRegistry::Create(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                             CancelFlag cancelled, const SessionCallback& done,
                             const TellSession& tell) {
  if (record.id.empty()) {
    record.id = RandomId();
  }
  MakeRoom();
  const SessionWaiter waiter{std::move(cancelled), done, tell};
  Admission admission;
  {
    MutexLock lock(mutex_);
    admission = AdmitCreate(record, waiter);
  }
  if (!admission.refusal.ok()) {
    done(std::move(admission.refusal));
  } else if (admission.existing != nullptr) {
    done(std::move(admission.existing));
  } else if (admission.started != nullptr && admission.started->restores) {
    StartRestore(admission.started);
  } else if (admission.started != nullptr) {
    StartCreation(admission.started, record, mesh);
  } else if (admission.joined.has_value() && tell) {
    tell(*admission.joined);
  }
}

void SessionRegistry::Open(const std::string& id, CancelFlag cancelled, const SessionCallback& done,
                           const TellSession& tell) {
  if (std::shared_ptr<Session> session = Loaded(id); session != nullptr) {
    done(std::move(session));
    return;
  }
  MakeRoom();
  Admission admission;
  {
    MutexLock lock(mutex_);
    admission = AdmitOpen(id, {std::move(cancelled), done, tell});
  }
  if (!admission.refusal.ok()) {
    done(std::move(admission.refusal));
  } else if (admission.existing != nullptr) {
    done(std::move(admission.existing));
  } else if (admission.started != nullptr) {
    StartRestore(admission.started);
  } else if (admission.joined.has_value() && tell) {
    tell(*admission.joined);
  }
}

// Only now: nothing leaves memory while there is room. Not under the lock, which Evict takes and
// leaves before sessions end; others may come meanwhile, so whether there is room is asked again.
void SessionRegistry::MakeRoom() {
  const auto has_room = [this] {
    MutexLock lock(mutex_);
    return !Full();
  };
  if (has_room()) return;
  Evict(has_room);
  if (!catalog_->keeps_meshes() && !has_room()) RemoveIdle();
}

SessionRegistry::Admission SessionRegistry::AdmitCreate(const SessionRecord& record,
                                                        const SessionWaiter& waiter) {
  const RequestKey key{record.request_id, record.request_fingerprint};
  Admission admission;
  if (!key.request_id.empty() && JoinEarlierRequest(key, waiter, &admission)) return admission;
  if (table_.Find(record.id) != nullptr || table_.FindMaking(record.id) != nullptr) {
    admission.refusal = TakenId(record.id);
  } else if (ending_.contains(record.id)) {
    admission.refusal = EndingId(record.id);
  } else if (table_.num_known() >= static_cast<size_t>(limits_.max_stored_sessions)) {
    admission.refusal = TooManySessions(limits_.max_stored_sessions, "keeps",
                                        "; delete one or raise --max-stored-sessions");
  } else if (admission.refusal = CheckKept(record.mesh_sha256); admission.refusal.ok()) {
    admission.refusal = CheckRoom();
  }
  if (admission.refusal.ok()) {
    admission.started =
        table_.StartMaking(record.id, key, record.mesh_sha256, /*restores=*/false, waiter);
  }
  return admission;
}

SessionRegistry::Admission SessionRegistry::AdmitOpen(const std::string& id,
                                                      const SessionWaiter& waiter) {
  Admission admission;
  KnownSession* known = table_.Find(id);
  if (known == nullptr) {
    admission.refusal = NoSuchSession(id);
  } else if (known->session != nullptr) {
    known->session->Touch();
    admission.existing = known->session;
  } else if (const MakingPtr making = table_.FindMaking(id); making != nullptr) {
    Join(making, waiter, &admission);
  } else if (admission.refusal = CheckRoom(); admission.refusal.ok()) {
    admission.started =
        table_.StartMaking(id, known->key, known->mesh_sha256, /*restores=*/true, waiter);
    admission.started->version = known->version;
  }
  return admission;
}

bool SessionRegistry::JoinEarlierRequest(const RequestKey& key, const SessionWaiter& waiter,
                                         Admission* admission) {
  KnownSession* known = table_.FindRequest(key.request_id);
  const MakingPtr making = known == nullptr ? table_.FindMakingOfRequest(key.request_id) : nullptr;
  if (known == nullptr && making == nullptr) return false;
  if ((known != nullptr ? known->key : making->key).fingerprint != key.fingerprint) {
    admission->refusal = OtherRequest(key.request_id);
  } else if (known != nullptr) {
    SessionWaiter claimant = waiter;
    claimant.claims = true;
    *admission = AdmitOpen(table_.IdOfRequest(key.request_id), claimant);
    if (admission->existing != nullptr) ++known->claims;
  } else {
    // Also where all who waited have cancelled: FinishCreation makes it again if it stops for that.
    Join(making, waiter, admission);
  }
  return true;
}

void SessionRegistry::Join(const MakingPtr& making, const SessionWaiter& waiter,
                           Admission* admission) {
  making->waiters.push_back(waiter);
  admission->joined = making->newest;
}

// The caller has found it and holds it, so it leaves the catalog by RemoveMesh only.
absl::Status SessionRegistry::CheckKept(const std::string& mesh_sha256) const {
  if (!catalog_->keeps_meshes()) return absl::OkStatus();
  const bool leaves = meshes_on_their_way_out_.contains(mesh_sha256);
  return leaves || catalog_->Find(mesh_sha256) == nullptr ? NoMeshAnyMore() : absl::OkStatus();
}

absl::Status SessionRegistry::CheckRoom() const {
  if (!Full()) return absl::OkStatus();
  return TooManySessions(
      limits_.max_sessions, "holds",
      " in memory, and all are in use; try again in a moment, delete one, or raise "
      "--max-sessions");
}

bool SessionRegistry::Full() const {
  return table_.num_loaded() >= static_cast<size_t>(limits_.max_sessions);
}

void SessionRegistry::StartCreation(const MakingPtr& making, const SessionRecord& record,
                                    const std::shared_ptr<const StoredMesh>& mesh) {
  maker_.Create(record, mesh, CallerOf(making),
                [this, making, record, mesh](absl::StatusOr<std::shared_ptr<Session>> made) {
                  if (!FinishCreation(making, std::move(made))) {
                    StartCreation(making, record, mesh);
                  }
                });
}

void SessionRegistry::StartRestore(const MakingPtr& making) {
  maker_.Restore(making->id, CallerOf(making),
                 [this, making](absl::StatusOr<std::shared_ptr<Session>> session) {
                   FinishRestore(making, std::move(session));
                 });
}

SessionCaller SessionRegistry::CallerOf(const MakingPtr& making) {
  return {.cancellation = Cancellation([this, making] {
            MutexLock lock(mutex_);
            return !making->wanted();
          }),
          .tell = [this, making](const SessionProgress& progress) {
            std::vector<TellSession> listening;
            {
              MutexLock lock(mutex_);
              making->newest = progress;
              for (const SessionWaiter& waiter : making->waiters) {
                if (waiter.tell) listening.push_back(waiter.tell);
              }
            }
            for (const TellSession& tell : listening) tell(progress);
          }};
}

bool SessionRegistry::FinishCreation(const MakingPtr& making,
                                     absl::StatusOr<std::shared_ptr<Session>> result) {
  std::vector<SessionWaiter> waiters;
  bool nobody_waits = false;
  {
    MutexLock lock(mutex_);
    if (absl::IsCancelled(result.status()) && making->wanted()) return false;
    waiters = table_.EndMaking(making);
    nobody_waits = waiters.empty();  // all have cancelled
    if (result.ok() && nobody_waits) {
      ending_.emplace(making->id, making->mesh_sha256);
    } else if (result.ok()) {
      KnownSession known;
      known.session = *result;
      known.key = making->key;
      known.mesh_sha256 = (*result)->mesh().sha256;
      known.claims = static_cast<int>(waiters.size());
      table_.Add(making->id, std::move(known));
    }
  }
  if (result.ok() && nobody_waits) {
    End(*result, WarnIfLeftBehind);
  }
  for (const SessionWaiter& waiter : waiters) {
    waiter.done(result);
  }
  return true;
}

void SessionRegistry::FinishRestore(const MakingPtr& making,
                                    absl::StatusOr<std::shared_ptr<Session>> result) {
  std::vector<SessionWaiter> waiters;
  std::shared_ptr<Session> unwanted;
  bool again = false;
  {
    MutexLock lock(mutex_);
    KnownSession* known = table_.Find(making->id);
    if (known != nullptr && known->session != nullptr) {
      result = known->session;  // an update has made it meanwhile
    } else if (known != nullptr && known->version != making->version) {
      // That one has left memory again, and what was made is the session before it.
      result = absl::CancelledError("the session was updated meanwhile");
      making->version = known->version;
    }
    // All who waited had cancelled, and then somebody came.
    again = absl::IsCancelled(result.status()) && known != nullptr && making->wanted();
    if (!again) waiters = table_.EndMaking(making);
    if (result.ok() && known != nullptr) {
      known->session = *result;
      known->mesh.reset();
      // Only now, and only of those who are answered: who cancelled while it was made has none.
      known->claims += static_cast<int>(
          std::count_if(waiters.begin(), waiters.end(),
                        [](const SessionWaiter& waiter) { return waiter.claims; }));
    } else if (result.ok()) {
      unwanted = *std::move(result);
      result = NoSuchSession(making->id);  // deleted meanwhile
    }
  }
  if (again) {
    StartRestore(making);
    return;
  }
  if (unwanted != nullptr) unwanted->Close(Session::CloseReason::kDeleted);
  if (result.ok()) observer_(making->id, Event::kRestored);
  for (const SessionWaiter& waiter : waiters) {
    waiter.done(result);
  }
}

void SessionRegistry::CancelWait(const CancelFlag& cancelled) {
  std::vector<SessionWaiter> gone;
  {
    MutexLock lock(mutex_);
    gone = table_.TakeWaiters(cancelled);
  }
  for (const SessionWaiter& waiter : gone) {
    waiter.done(absl::CancelledError("the client has cancelled the call"));
  }
}

void SessionRegistry::Abandon(const std::shared_ptr<Session>& session) {
  {
    MutexLock lock(mutex_);
    KnownSession* known = table_.Find(session->id());
    // Clients choose ids: another session may have it by now.
    if (known == nullptr || known->session != session || --known->claims > 0) return;
    Take(session->id());
  }
  End(session, WarnIfLeftBehind);
}

void SessionRegistry::End(const std::shared_ptr<Session>& session, const StatusCallback& done) {
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

void SessionRegistry::Forget(const std::string& id, StatusCallback done) {
  store_->Delete(id, "", kStoreEpoch,
                 [this, id, done = std::move(done)](const absl::Status& status) {
                   // Only now: who comes to watch after it shall not find the record any longer.
                   observer_(id, Event::kDeleted);
                   {
                     MutexLock lock(mutex_);
                     ending_.erase(id);
                   }
                   done(status);
                 });
}

std::shared_ptr<Session> SessionRegistry::Loaded(const std::string& id) {
  MutexLock lock(mutex_);
  const KnownSession* known = table_.Find(id);
  if (known == nullptr || known->session == nullptr) return nullptr;
  known->session->Touch();
  return known->session;
}

absl::StatusOr<std::shared_ptr<Session>> SessionRegistry::Find(const std::string& id) {
  std::shared_ptr<Session> session = Loaded(id);
  if (session == nullptr) return NoSuchSession(id);
  return session;
}

void SessionRegistry::Look(const std::string& id,
                           const std::function<void(absl::StatusOr<View>)>& done) {
  store_->Get(id, [this, id, done](absl::StatusOr<SessionRecord> record) {
    if (record.ok()) {
      std::shared_ptr<Session> session = Loaded(id);
      done(View{*std::move(record), std::move(session)});
    } else {
      done(absl::IsNotFound(record.status()) ? NoSuchSession(id) : record.status());
    }
  });
}

void SessionRegistry::List(const SessionStore::ListRequest& request,
                           const std::function<void(absl::StatusOr<ViewPage>)>& done) {
  store_->List(request, [this, done](absl::StatusOr<SessionStore::Page> page) {
    if (!page.ok()) {
      done(page.status());
      return;
    }
    ViewPage views{.views = {}, .next = std::move(page->next)};
    {
      MutexLock lock(mutex_);
      for (SessionRecord& record : page->records) {
        const KnownSession* known = table_.Find(record.id);
        views.views.push_back({std::move(record), known == nullptr ? nullptr : known->session});
      }
    }
    done(std::move(views));
  });
}

void SessionRegistry::Update(const std::string& id, const std::string& etag,
                             SessionMaker::Change change, CancelFlag cancelled,
                             const std::function<void(absl::StatusOr<View>)>& done,
                             TellSession tell) {
  MakeRoom();
  absl::Status refusal;
  {
    MutexLock lock(mutex_);
    const KnownSession* known = table_.Find(id);
    if (known == nullptr) {
      refusal = NoSuchSession(id);
    } else if (known->session == nullptr) {
      refusal = CheckRoom();
    }
  }
  if (!refusal.ok()) {
    done(std::move(refusal));
    return;
  }
  updates_.Update(id, etag, std::move(change),
                  {.cancellation = Cancellation(
                       [cancelled = std::move(cancelled)] { return cancelled->load(); }),
                   .tell = std::move(tell)},
                  [id, done](absl::StatusOr<SessionMaker::Made> remade) {
                    if (remade.ok()) {
                      done(View{std::move(remade->record), std::move(remade->session)});
                    } else if (HasReason(remade.status(), ErrorReason::kSessionNotFound)) {
                      done(NoSuchSession(id));
                    } else {
                      done(remade.status());
                    }
                  });
}

absl::Status SessionRegistry::Replace(const SessionMaker::Made& remade, bool other_handles) {
  std::shared_ptr<Session> before;
  {
    MutexLock lock(mutex_);
    KnownSession* known = table_.Find(remade.record.id);
    if (known == nullptr) return NoSuchSession(remade.record.id);  // deleted meanwhile
    before = std::exchange(known->session, remade.session);
    known->mesh.reset();
    ++known->version;
    if (before != nullptr) known->evicted.push_back(before);
    // Whoever opens it from now on gets the new one; who holds another shall know why.
    for (const std::weak_ptr<Session>& earlier : known->evicted) {
      if (const std::shared_ptr<Session> held = earlier.lock()) held->MarkUpdated(other_handles);
    }
  }
  if (before != nullptr) before->Close(Session::CloseReason::kUpdated);
  return absl::OkStatus();
}

void SessionRegistry::Delete(const std::string& id, const StatusCallback& done) {
  std::optional<KnownSession> known;
  {
    MutexLock lock(mutex_);
    known = Take(id);
  }
  if (!known.has_value()) {
    done(NoSuchSession(id));
  } else if (known->session == nullptr) {
    Forget(id, done);
  } else {
    End(known->session, done);
  }
}

int SessionRegistry::Evict(const std::function<bool()>& enough) {
  int count = 0;
  while (!enough()) {
    std::shared_ptr<Session> evicted;
    {
      MutexLock lock(mutex_);
      const std::string id = table_.LeastRecentlyUsed(clock_->Now() - kInUse);
      if (id.empty()) break;
      KnownSession* known = table_.Find(id);
      evicted = std::move(known->session);
      known->last_used = evicted->last_used();
      std::erase_if(known->evicted, [](const auto& earlier) { return earlier.expired(); });
      known->evicted.push_back(evicted);
      if (!catalog_->keeps_meshes()) known->mesh = evicted->shared_mesh();
    }
    observer_(evicted->id(), Event::kEvicted);
    // Here and now, whoever still holds it: nothing is being solved in a session not in use.
    evicted->Close(Session::CloseReason::kEvicted);
    ++count;
  }
  if (count > 0) spdlog::info("{} sessions that were not in use have left memory", count);
  return count;
}

int SessionRegistry::RemoveIdle() {
  std::vector<std::pair<std::string, KnownSession>> removed;
  {
    MutexLock lock(mutex_);
    for (const std::string& id : table_.UnusedSince(clock_->Now() - limits_.session_idle_ttl)) {
      removed.emplace_back(id, *Take(id));
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

int SessionRegistry::RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since) {
  std::vector<std::pair<std::string, KnownSession>> removed;
  {
    MutexLock lock(mutex_);
    for (const std::string& id : ids) {
      if (table_.Find(id) != nullptr && !table_.IsInUse(id, since)) {
        removed.emplace_back(id, *Take(id));
      }
    }
  }
  const int count = static_cast<int>(removed.size());
  EndUnused(removed);
  return count;
}

void SessionRegistry::EndUnused(const std::vector<std::pair<std::string, KnownSession>>& removed) {
  for (const auto& [id, known] : removed) {
    if (known.session != nullptr) known.session->Close(Session::CloseReason::kDeleted);
    Forget(id, WarnIfLeftBehind);
  }
}

SessionRegistry::Use SessionRegistry::UsedSince(Clock::TimePoint since) const {
  Use use;
  std::set<std::string> meshes;
  MutexLock lock(mutex_);
  use.sessions = table_.InUse(since);
  for (const std::string& id : use.sessions) meshes.insert(table_.Find(id)->mesh_sha256);
  use.meshes.assign(meshes.begin(), meshes.end());
  return use;
}

bool SessionRegistry::Knows(const std::string& id) const {
  MutexLock lock(mutex_);
  return table_.Find(id) != nullptr;
}

int SessionRegistry::size() const {
  MutexLock lock(mutex_);
  return static_cast<int>(table_.num_loaded_in_table());
}

int SessionRegistry::CountMadeFrom(const std::string& mesh_sha256) const {
  MutexLock lock(mutex_);
  return CountMadeFromLocked(mesh_sha256);
}

int SessionRegistry::CountMadeFromLocked(const std::string& mesh_sha256) const {
  const auto ending =
      std::count_if(ending_.begin(), ending_.end(),
                    [&mesh_sha256](const auto& entry) { return entry.second == mesh_sha256; });
  return table_.CountMadeFrom(mesh_sha256) + static_cast<int>(ending);
}

absl::Status SessionRegistry::RemoveMesh(const std::string& sha256) {
  // Sessions in memory keep what nobody could read again.
  if (!catalog_->keeps_meshes()) return catalog_->Remove(sha256);
  {
    MutexLock lock(mutex_);
    const int sessions = CountMadeFromLocked(sha256);
    if (sessions > 0) return MeshInUse(sessions);
    meshes_on_their_way_out_.insert(sha256);
  }
  absl::Status removed = catalog_->Remove(sha256);
  MutexLock lock(mutex_);
  meshes_on_their_way_out_.erase(meshes_on_their_way_out_.find(sha256));
  return removed;
}

std::optional<KnownSession> SessionRegistry::Take(const std::string& id) {
  std::optional<KnownSession> known = table_.Take(id);
  if (known.has_value()) ending_.emplace(id, known->mesh_sha256);
  return known;
}

}  // namespace tissueform
