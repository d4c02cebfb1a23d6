// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_errors.h"
#include "server/session/session_evictor.h"
#include "server/session/session_factory.h"
#include "server/session/session_progress.h"
#include "server/session/session_table.h"
#include "server/store/session_store.h"

namespace tissueform {

// How sessions come: who may have one made, who joins a making that is under way, and how a making
// ends for all who waited for it.
//
// Thread-safe. Callbacks are called without a lock held, from the calling thread or from a worker.
class SessionLoader {
 public:
  // All pointers must outlive it and the sessions.
  SessionLoader(const ServiceLimits& limits, SharedSessionTable* sessions, MeshCatalog* catalog,
                SessionFactory* maker, SessionEvictor* endings, SessionObserver observer);

  // See SessionRegistry. The record has an id.
  void Create(const SessionRecord& record, const std::shared_ptr<const StoredMesh>& mesh,
              const SessionWaiter& waiter) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void Open(const std::string& id, const SessionWaiter& waiter)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void CancelWait(const SessionWaiter::CancelFlag& cancelled) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // This server may not answer the session: who waits for it to be made from its record is told
  // SESSION_MOVED, and need not wait for a store that may be away.
  void Lost(const std::string& id) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // See SessionRegistry.
  void set_most_of_owner(int most) { most_of_owner_ = most; }

  // Of a session that is to be made beside the one in the store. Errors: NotFound,
  // ResourceExhausted.
  absl::Status AdmitRemaking(const std::string& id) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

 private:
  using PendingSessionPtr = SessionTable::PendingSessionPtr;

  // What became of a call when it arrived.
  struct Admission {
    absl::Status refusal;
    std::shared_ptr<Session> existing;
    PendingSessionPtr started;
    std::shared_ptr<Session> lost = nullptr;  // was in the table, though it is not held
    std::optional<SessionProgress> joined;    // how far a making is that was under way
  };

  Admission AdmitCreate(const SessionRecord& record, const SessionWaiter& waiter)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  Admission AdmitOpen(const std::string& id, const SessionWaiter& waiter)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  // False when no session and no making has the request id.
  bool JoinEarlierRequest(const RequestKey& key, const SessionWaiter& waiter, Admission* admission)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  static void Join(const PendingSessionPtr& making, const SessionWaiter& waiter,
                   Admission* admission);
  // Of a mesh that is to be made into a session. Errors: NotFound.
  absl::Status CheckKept(const std::string& mesh_sha256) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  // Errors: ResourceExhausted.
  absl::Status CheckQuota(const std::string& owner) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  // Errors: ResourceExhausted.
  absl::Status CheckRoom() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  bool Full() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(sessions_->mutex);
  // Tries to have room for one more session in memory.
  void MakeRoom() ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // What an admission leaves to be done without the lock.
  void CloseLost(const std::shared_ptr<Session>& lost) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  // The caller's answer, where it was not `started`.
  static void Answer(const Admission& admission, const SessionWaiter& waiter);
  void StartCreation(const PendingSessionPtr& making, const SessionRecord& record,
                     const std::shared_ptr<const StoredMesh>& mesh);
  void StartRestore(const PendingSessionPtr& making);
  // All who wait for it, at any time.
  SessionCaller CallerOf(const PendingSessionPtr& making);
  // False when all who waited had cancelled, and then somebody came: it is to be made again.
  bool FinishCreation(const PendingSessionPtr& making,
                      absl::StatusOr<std::shared_ptr<Session>> result)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  void FinishRestore(const PendingSessionPtr& making,
                     absl::StatusOr<std::shared_ptr<Session>> result)
      ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  int most_of_owner_ = 0;  // 0: no limit; constant once requests are served
  const ServiceLimits limits_;
  SharedSessionTable* const sessions_;
  MeshCatalog* const catalog_;
  SessionFactory* const maker_;
  SessionEvictor* const endings_;
  const SessionObserver observer_;
};

}  // namespace tissueform
