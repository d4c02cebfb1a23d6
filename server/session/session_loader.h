// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_lease_table.h"
#include "server/session/session_progress.h"
#include "server/session/session_table.h"
#include "server/session/shared_preparation.h"
#include "server/session/store_sync.h"
#include "server/session/worker_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// Creates sessions on the workers, and loads them again from their records: each once for all its
// callers (single flight), on a preparation that sessions share.
//
// Thread-safe. Its lock comes before that of the table, and is held over no other call. Callbacks
// come once, without a lock, from the calling thread, a worker or a thread of the store.
class SessionLoader {
 public:
  using CancelFlag = std::shared_ptr<const std::atomic<bool>>;
  using SessionCallback = std::function<void(absl::StatusOr<std::shared_ptr<Session>>)>;

  // All pointers must outlive it and its sessions.
  SessionLoader(MemoryBudget* budget, WorkerPool* pool, SessionStore* store, MeshCatalog* catalog,
                SessionLeaseTable* leases, SessionTable* table, StoreSync* sync,
                const Clock* clock);
  SessionLoader(const SessionLoader&) = delete;
  SessionLoader& operator=(const SessionLoader&) = delete;

  // `named` gives what Create and Open refuse with, with the server that has room where one is
  // known; where several share a store. Call it before anything else.
  void set_naming_room(std::function<absl::Status(const absl::Status&)> named) {
    naming_room_ = std::move(named);
  }

  // Makes a session of `record` on a worker, keeps the record and calls `done` once. A record
  // without id gets a random one. Calls with the same request id share one session; its creation
  // stops early when `cancelled` is set for all its callers. `mesh` is the one that the record
  // names. `on_progress` gets the progress, also of a creation that was begun for another caller.
  //
  // Every successful answer is a claim on the session, see StoreSync::Abandon. A session whose
  // lease cannot be taken is created, too, but CheckHeld refuses it.
  //
  // Errors: those of Session::Create, SessionTable::BeginCreation and SessionStore::Create;
  // InvalidArgument (the request id belongs to another request); Cancelled.
  void Create(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
              CancelFlag cancelled, const SessionCallback& done,
              const SessionProgressCallback& on_progress = {});

  // Gives the session, loaded from its record where it is not in memory. At once where it is.
  //
  // Errors: NotFound; those of Session::Create, SessionLeaseTable::Take, SessionStore::Get and
  // MeshCatalog::Load; ResourceExhausted; Cancelled; Unavailable (SESSION_MOVED: it was lost while
  // it was loaded).
  void Open(const std::string& id, CancelFlag cancelled, const SessionCallback& done,
            const SessionProgressCallback& on_progress = {});

  // Prepares the session again from its record as `change`, on a worker, leaves it, then puts that
  // into the place of the old one, which closes as updated. The name, and where the handles' names
  // and their order stay also the committed poses, are kept; other handles begin at rest. `etag` is
  // that of the version that is changed; empty: any. `done` gets the session when its new record is
  // durable as far as the store is; after an error it is as it was.
  //
  // Errors: NotFound; Aborted (another version, or another update was faster); those of Open, of
  // `change` and of SessionStore::Update.
  using Change =
      std::function<absl::StatusOr<SessionRecord>(SessionRecord record, const StoredMesh& mesh)>;
  using ViewCallback = StoreSync::ViewCallback;
  void Update(const std::string& id, const std::string& etag, const Change& change,
              CancelFlag cancelled, const ViewCallback& done,
              SessionProgressCallback on_progress = {});

  // Answers the callers of Create and Open that gave this flag and still wait: Cancelled. What is
  // made for no other caller stops at its next stage.
  void CancelWait(const CancelFlag& cancelled) ABSL_LOCKS_EXCLUDED(mutex_);

  // This server may not answer the session: callers that wait for it to be loaded get
  // SESSION_MOVED, and need not wait for a store that may be away.
  void Lost(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);

  // From now on nothing is posted to the pool. Call it before the pool ends, and end the store's
  // calls before this.
  void Stop() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  // A caller that waits for a session.
  struct Waiter {
    CancelFlag cancelled;
    SessionCallback done;
    SessionProgressCallback on_progress;  // may be empty
    bool claims = false;  // a successful answer is one more claim on a session that is loaded
  };
  // What is created or loaded.
  struct Flight {
    // Constant.
    std::string id;
    SessionRecord record;                    // of a creation
    std::shared_ptr<const StoredMesh> mesh;  // null: it is loaded
    // Guarded by mutex_.
    std::vector<Waiter> waiters;
    std::optional<SessionProgress> newest = std::nullopt;

    bool creates() const { return mesh != nullptr; }
    // Whether a caller waits for it that has not canceled.
    bool wanted() const;
  };
  using FlightPtr = std::shared_ptr<Flight>;
  // The caller for which a session is made.
  struct Caller {
    Cancellation cancellation;
    SessionProgressCallback on_progress;  // may be empty

    void Report(SessionStage stage) const {
      if (on_progress) on_progress({stage});
    }
  };
  // What became of a call when it arrived: one of these, or it waits.
  struct Arrival {
    SessionTable::Found found = {};
    FlightPtr started = nullptr;
    std::optional<SessionProgress> joined = std::nullopt;  // how far that flight is
  };

  Waiter MakeWaiter(CancelFlag cancelled, const SessionCallback& done,
                    const SessionProgressCallback& on_progress);
  void CreateKnown(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                   const Waiter& waiter);
  void MakeRoom();
  Arrival ArriveToCreate(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                         const Waiter& waiter) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Arrival ArriveToOpen(const std::string& id, const Waiter& waiter)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Empty when no session was created by the request and none is being created.
  std::optional<Arrival> JoinEarlierRequest(const RequestKey& key, const Waiter& waiter)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  static Arrival Join(const FlightPtr& flight, const Waiter& waiter);
  void GoOn(const Arrival& arrival, const Waiter& waiter) ABSL_LOCKS_EXCLUDED(mutex_);

  void StartCreation(const FlightPtr& flight);
  void StartLoading(const FlightPtr& flight);
  void FinishCreation(const FlightPtr& flight, const absl::StatusOr<std::shared_ptr<Session>>& made)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void FinishLoading(const FlightPtr& flight, absl::StatusOr<std::shared_ptr<Session>> made)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // All callers that wait for it at the time.
  Caller CallerOf(const FlightPtr& flight) ABSL_LOCKS_EXCLUDED(mutex_);
  std::vector<Waiter> EndFlight(const FlightPtr& flight) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Makes a session of `record` and keeps nothing; the view's record has the order of vertices that
  // this has found. Errors: those of Session::Create.
  void Make(SessionRecord record, std::shared_ptr<const StoredMesh> mesh, Caller caller,
            ViewCallback done);
  // The record is kept, then the session is taken: no record is of a session that could not be
  // made. Errors: those of SessionStore::Create.
  void Keep(SessionView made, const SessionCallback& done);
  // Takes the session of a record in the store, and makes it of what `change` leaves. After an
  // error it is given back, unless this server holds it otherwise.
  void Remake(const std::string& id, const Change& change, const Caller& caller,
              const ViewCallback& done);
  void MakeChanged(const SessionRecord& record, const Change& change, Caller caller,
                   ViewCallback done);
  // `done` with sessions that have this hold; after an error it is given back before.
  ViewCallback WithHold(SessionLeaseHandlePtr hold, const ViewCallback& done);
  void KeepUpdate(absl::StatusOr<SessionView> remade, const Caller& caller,
                  const ViewCallback& done);
  // False when the pool may have ended.
  bool PostUnlessStopped(WorkerPool::Job job) ABSL_LOCKS_EXCLUDED(mutex_);

  // Constant.
  MemoryBudget* const budget_;
  WorkerPool* const pool_;
  SessionStore* const store_;
  MeshCatalog* const catalog_;
  SessionLeaseTable* const leases_;
  SessionTable* const table_;
  StoreSync* const sync_;
  const Clock* const clock_;
  std::function<absl::Status(const absl::Status&)> naming_room_;  // empty: no other server has any

  // Self-synchronised.
  SharedPreparations preparations_;

  Mutex mutex_;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
  // By id. There is a flight of an id if and only if the table has a place for it: both come and go
  // under mutex_.
  std::map<std::string, FlightPtr> flights_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
