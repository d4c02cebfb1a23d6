// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_lease_table.h"
#include "server/session/session_progress.h"
#include "server/session/shared_preparation.h"
#include "server/session/worker_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// Who waits for a session: whether anybody still does, and how they are told how far it is.
struct SessionCaller {
  Cancellation cancellation;
  TellSession tell;  // may be empty

  void Tell(SessionStage stage) const {
    if (tell) tell({stage});
  }
};

// Makes sessions on the workers, new ones and those that come back from their records, and shares
// preparations between them. Who knows them and who waits for them is the registry's.
//
// Thread-safe. A callback comes once, from a worker or a thread of the store. What is
// made for nobody any longer stops at its next stage with Cancelled.
class SessionFactory {
 public:
  using Callback = std::function<void(absl::StatusOr<std::shared_ptr<Session>>)>;

  // A session, and the record that it was made of with the order of vertices that this has found.
  struct Made {
    SessionRecord record;
    std::shared_ptr<Session> session;
  };
  using MadeCallback = std::function<void(absl::StatusOr<Made>)>;

  // All must outlive it and its sessions.
  SessionFactory(MemoryBudget* budget, WorkerPool* pool, SessionStore* store, MeshCatalog* catalog,
                 SessionLeaseTable* holds, const Clock* clock);

  // Makes a session of `record` and keeps nothing. `mesh` is the one that the record names. Errors:
  // those of Session::Create.
  void Make(SessionRecord record, std::shared_ptr<const StoredMesh> mesh, SessionCaller caller,
            MadeCallback done);

  // Make, then the record is kept, and then the session is taken: no record tells of a session that
  // could not be made. One that cannot be taken is there all the same, but CheckHeld refuses it.
  // Errors: and those of SessionStore::Create.
  void Create(SessionRecord record, std::shared_ptr<const StoredMesh> mesh, SessionCaller caller,
              Callback done);

  // Takes the session of a record in the store, and makes it. After an error it is given back, if
  // nobody else here holds it. Errors: those of SessionLeaseTable::Take, SessionStore::Get,
  // MeshCatalog::Load and Session::Create.
  void Restore(const std::string& id, SessionCaller caller, Callback done);

  // The same of a record in the store as `change` has left it, and keeps nothing; the record
  // has the etag of the version that was changed. Errors: those of Restore and of `change`, which
  // comes on a worker.
  using Change =
      std::function<absl::StatusOr<SessionRecord>(SessionRecord record, const StoredMesh& mesh)>;
  void Remake(const std::string& id, Change change, SessionCaller caller, MadeCallback done);

  // Nothing is posted to the pool any longer by what the store answers. Call it before the pool
  // ends.
  void Stop();

 private:
  // A session whose record has just been kept.
  void TakeNew(std::shared_ptr<Session> session, int64_t epoch, const Callback& done);
  void Read(const std::string& id, Change change, SessionCaller caller, MadeCallback done);
  // `done` with sessions that have this hold; where there is none it is given back before.
  MadeCallback WithHold(SessionLeaseHandlePtr hold, MadeCallback done);
  // On a worker.
  void MakeChanged(const SessionRecord& record, const Change& change, SessionCaller caller,
                   MadeCallback done);
  // False when the pool may have ended.
  bool PostUnlessStopped(WorkerPool::Job job) ABSL_LOCKS_EXCLUDED(mutex_);

  // Constant.
  MemoryBudget* const budget_;
  WorkerPool* const pool_;
  SessionStore* const store_;
  MeshCatalog* const catalog_;
  SessionLeaseTable* const holds_;
  const Clock* const clock_;

  // Self-synchronised.
  SharedPreparations preparations_;

  Mutex mutex_;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace tissueform
