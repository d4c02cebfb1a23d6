// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_loader.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "absl/status/status.h"

#include "core/base/error_reason.h"
#include "server/session/quotas.h"
#include "server/session/session_errors.h"

namespace tissueform {

SessionLoader::SessionLoader(const ServiceLimits& limits, SharedSessionTable* sessions,
                             MeshCatalog* catalog, SessionFactory* maker, SessionEvictor* endings,
                             SessionObserver observer)
    : limits_(limits),
      sessions_(sessions),
      catalog_(catalog),
      maker_(maker),
      endings_(endings),
      observer_(std::move(observer)) {}

void SessionLoader::Create(const SessionRecord& record,
                           const std::shared_ptr<const StoredMesh>& mesh,
                           const SessionWaiter& waiter) {
  MakeRoom();
  Admission admission;
  {
    MutexLock lock(sessions_->mutex);
    admission = AdmitCreate(record, waiter);
  }
  CloseLost(admission.lost);
  if (admission.started == nullptr) {
    Answer(admission, waiter);
  } else if (admission.started->restores) {
    StartRestore(admission.started);
  } else {
    StartCreation(admission.started, record, mesh);
  }
}

void SessionLoader::Open(const std::string& id, const SessionWaiter& waiter) {
  MakeRoom();
  Admission admission;
  {
    MutexLock lock(sessions_->mutex);
    admission = AdmitOpen(id, waiter);
  }
  CloseLost(admission.lost);
  if (admission.started == nullptr) {
    Answer(admission, waiter);
  } else {
    StartRestore(admission.started);
  }
}

void SessionLoader::CloseLost(const std::shared_ptr<Session>& lost) {
  if (lost == nullptr) return;
  lost->Close(Session::CloseReason::kMoved);
  observer_(lost->id(), SessionEvent::kMoved);
}

void SessionLoader::Answer(const Admission& admission, const SessionWaiter& waiter) {
  if (!admission.refusal.ok()) {
    waiter.done(admission.refusal);
  } else if (admission.existing != nullptr) {
    waiter.done(admission.existing);
  } else if (admission.joined.has_value() && waiter.tell) {
    waiter.tell(*admission.joined);
  }
}

absl::Status SessionLoader::AdmitRemaking(const std::string& id) {
  MakeRoom();
  MutexLock lock(sessions_->mutex);
  const SessionEntry* known = sessions_->table.Find(id);
  if (known == nullptr) return NoSuchSession(id);
  return known->session == nullptr ? CheckRoom() : absl::OkStatus();
}

// Only now: nothing leaves memory while there is room. Not under the lock, which Evict takes and
// leaves before sessions end; others may come meanwhile, so whether there is room is asked again.
void SessionLoader::MakeRoom() {
  const auto has_room = [this] {
    MutexLock lock(sessions_->mutex);
    return !Full();
  };
  if (has_room()) return;
  endings_->Evict(has_room);
  if (!catalog_->keeps_meshes() && !has_room()) endings_->RemoveIdle();
}

SessionLoader::Admission SessionLoader::AdmitCreate(const SessionRecord& record,
                                                    const SessionWaiter& waiter) {
  const RequestKey key = RequestKeyOf(record);
  Admission admission;
  if (!key.request_id.empty() && JoinEarlierRequest(key, waiter, &admission)) {
    return admission;
  }
  if (sessions_->table.Find(record.id) != nullptr ||
      sessions_->table.FindMaking(record.id) != nullptr) {
    admission.refusal = TakenId(record.id);
  } else if (sessions_->table.IsEnding(record.id)) {
    admission.refusal = EndingId(record.id);
  } else if (sessions_->table.num_known() >= static_cast<size_t>(limits_.max_stored_sessions)) {
    admission.refusal = TooManySessions(limits_.max_stored_sessions, "keeps",
                                        "; delete one or raise --max-stored-sessions");
  } else if (admission.refusal = CheckQuota(record.owner); !admission.refusal.ok()) {
    // said
  } else if (admission.refusal = CheckKept(record.mesh_sha256); admission.refusal.ok()) {
    admission.refusal = CheckRoom();
  }
  if (admission.refusal.ok()) {
    admission.started =
        sessions_->table.StartMaking(record.id, key, record.owner, record.mesh_sha256,
                                     /*restores=*/false, waiter);
  }
  return admission;
}

SessionLoader::Admission SessionLoader::AdmitOpen(const std::string& id,
                                                  const SessionWaiter& waiter) {
  Admission admission;
  SessionEntry* known = sessions_->table.Find(id);
  if (known != nullptr && known->session != nullptr && !known->session->CheckHeld().ok()) {
    admission.lost = std::exchange(known->session, nullptr);
  }
  if (known == nullptr) {
    admission.refusal = NoSuchSession(id);
  } else if (known->session != nullptr) {
    known->session->Touch();
    admission.existing = known->session;
  } else if (const PendingSessionPtr making = sessions_->table.FindMaking(id); making != nullptr) {
    Join(making, waiter, &admission);
  } else if (admission.refusal = CheckRoom(); admission.refusal.ok()) {
    admission.started = sessions_->table.StartMaking(id, known->key, known->owner,
                                                     known->mesh_sha256, /*restores=*/true, waiter);
    admission.started->version = known->version;
  }
  return admission;
}

bool SessionLoader::JoinEarlierRequest(const RequestKey& key, const SessionWaiter& waiter,
                                       Admission* admission) {
  SessionEntry* known = sessions_->table.FindRequest(key.request_id);
  const PendingSessionPtr making =
      known == nullptr ? sessions_->table.FindMakingOfRequest(key.request_id) : nullptr;
  if (known == nullptr && making == nullptr) return false;
  if ((known != nullptr ? known->key : making->key).fingerprint != key.fingerprint) {
    admission->refusal = OtherRequest(key.request_id.substr(key.request_id.find('\n') + 1));
  } else if (known != nullptr) {
    SessionWaiter claimant = waiter;
    claimant.claims = true;
    *admission = AdmitOpen(sessions_->table.IdOfRequest(key.request_id), claimant);
    if (admission->existing != nullptr) ++known->claims;
  } else {
    // Also where all who waited have cancelled: FinishCreation makes it again if it stops for that.
    Join(making, waiter, admission);
  }
  return true;
}

void SessionLoader::Join(const PendingSessionPtr& making, const SessionWaiter& waiter,
                         Admission* admission) {
  making->waiters.push_back(waiter);
  admission->joined = making->newest;
}

// The caller has found it and holds it, so it leaves the catalog by RemoveMesh only.
absl::Status SessionLoader::CheckKept(const std::string& mesh_sha256) const {
  if (!catalog_->keeps_meshes()) return absl::OkStatus();
  const bool leaves = sessions_->table.IsLeaving(mesh_sha256);
  return leaves || catalog_->Find(mesh_sha256) == nullptr ? NoMeshAnyMore() : absl::OkStatus();
}

absl::Status SessionLoader::CheckQuota(const std::string& owner) const {
  if (most_of_owner_ == 0 || owner.empty() || sessions_->table.CountOf(owner) < most_of_owner_) {
    return absl::OkStatus();
  }
  constexpr std::chrono::minutes kUntilSomeMayBeGone{1};
  return QuotaExceeded("sessions", "sessions", most_of_owner_, kUntilSomeMayBeGone);
}

absl::Status SessionLoader::CheckRoom() const {
  if (!Full()) return absl::OkStatus();
  return TooManySessions(
      limits_.max_sessions, "holds",
      " in memory, and all are in use; try again in a moment, delete one, or raise "
      "--max-sessions");
}

bool SessionLoader::Full() const {
  return sessions_->table.num_loaded() >= static_cast<size_t>(limits_.max_sessions);
}

void SessionLoader::StartCreation(const PendingSessionPtr& making, const SessionRecord& record,
                                  const std::shared_ptr<const StoredMesh>& mesh) {
  maker_->Create(record, mesh, CallerOf(making),
                 [this, making, record, mesh](absl::StatusOr<std::shared_ptr<Session>> made) {
                   if (!FinishCreation(making, std::move(made))) {
                     StartCreation(making, record, mesh);
                   }
                 });
}

void SessionLoader::StartRestore(const PendingSessionPtr& making) {
  maker_->Restore(making->id, CallerOf(making),
                  [this, making](absl::StatusOr<std::shared_ptr<Session>> session) {
                    FinishRestore(making, std::move(session));
                  });
}

SessionCaller SessionLoader::CallerOf(const PendingSessionPtr& making) {
  return {.cancellation = Cancellation([this, making] {
            MutexLock lock(sessions_->mutex);
            return !making->wanted();
          }),
          .tell = [this, making](const SessionProgress& progress) {
            std::vector<TellSession> listening;
            {
              MutexLock lock(sessions_->mutex);
              making->newest = progress;
              for (const SessionWaiter& waiter : making->waiters) {
                if (waiter.tell) listening.push_back(waiter.tell);
              }
            }
            for (const TellSession& tell : listening) tell(progress);
          }};
}

bool SessionLoader::FinishCreation(const PendingSessionPtr& making,
                                   absl::StatusOr<std::shared_ptr<Session>> result) {
  std::vector<SessionWaiter> waiters;
  bool nobody_waits = false;
  {
    MutexLock lock(sessions_->mutex);
    if (absl::IsCancelled(result.status()) && making->wanted()) return false;
    waiters = sessions_->table.EndMaking(making);
    nobody_waits = waiters.empty();  // all have cancelled
    if (result.ok() && nobody_waits) {
      sessions_->table.TakeUnknown(making->id, making->mesh_sha256);
    } else if (result.ok()) {
      SessionEntry known;
      known.session = *result;
      known.key = making->key;
      known.owner = making->owner;
      known.mesh_sha256 = (*result)->mesh().sha256;
      known.claims = static_cast<int>(waiters.size());
      sessions_->table.Add(making->id, std::move(known));
    }
  }
  if (result.ok() && nobody_waits) {
    endings_->EndUnwanted(*result);
  }
  for (const SessionWaiter& waiter : waiters) {
    waiter.done(result);
  }
  return true;
}

void SessionLoader::FinishRestore(const PendingSessionPtr& making,
                                  absl::StatusOr<std::shared_ptr<Session>> result) {
  std::vector<SessionWaiter> waiters;
  std::shared_ptr<Session> unwanted;
  std::shared_ptr<Session> lost;
  bool again = false;
  if (result.ok()) {
    if (const absl::Status held = (*result)->CheckHeld(); !held.ok()) {
      (*result)->Close(Session::CloseReason::kMoved);
      result = held;
    }
  }
  {
    MutexLock lock(sessions_->mutex);
    SessionEntry* known = sessions_->table.Find(making->id);
    if (known != nullptr && known->session != nullptr && !known->session->CheckHeld().ok()) {
      lost = std::exchange(known->session, nullptr);
    }
    if (known != nullptr && known->session != nullptr) {
      result = known->session;  // an update has made it meanwhile
    } else if (known != nullptr && known->version != making->version) {
      // That one has left memory again, and what was made is the session before it.
      result = absl::CancelledError("the session was updated");
      making->version = known->version;
    }
    // All who waited had cancelled, and then somebody came.
    again = absl::IsCancelled(result.status()) && known != nullptr && making->wanted();
    if (!again) waiters = sessions_->table.EndMaking(making);
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
  CloseLost(lost);
  if (again) {
    StartRestore(making);
    return;
  }
  if (HasReason(result.status(), ErrorReason::kSessionNotFound)) endings_->Gone(making->id);
  if (unwanted != nullptr) unwanted->Close(Session::CloseReason::kDeleted);
  if (result.ok()) observer_(making->id, SessionEvent::kRestored);
  for (const SessionWaiter& waiter : waiters) {
    waiter.done(result);
  }
}

void SessionLoader::Lost(const std::string& id) {
  std::vector<SessionWaiter> waiters;
  {
    MutexLock lock(sessions_->mutex);
    const PendingSessionPtr making = sessions_->table.FindMaking(id);
    if (making != nullptr && making->restores) waiters = std::exchange(making->waiters, {});
  }
  for (const SessionWaiter& waiter : waiters) {
    waiter.done(SessionMoved(""));
  }
}

void SessionLoader::CancelWait(const SessionWaiter::CancelFlag& cancelled) {
  std::vector<SessionWaiter> gone;
  {
    MutexLock lock(sessions_->mutex);
    gone = sessions_->table.TakeWaiters(cancelled);
  }
  for (const SessionWaiter& waiter : gone) {
    waiter.done(absl::CancelledError("the client canceled the call"));
  }
}

}  // namespace tissueform
