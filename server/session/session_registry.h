// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/pose_commits.h"
#include "server/session/session.h"
#include "server/session/session_evictor.h"
#include "server/session/session_factory.h"
#include "server/session/session_lease_table.h"
#include "server/session/session_loader.h"
#include "server/session/session_ownership.h"
#include "server/session/session_progress.h"
#include "server/session/session_table.h"
#include "server/session/session_updates.h"
#include "server/session/store_sync.h"
#include "server/session/worker_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// The sessions of the server by their id: each has its record in a store, and those that are used
// are in memory. One that was not used for a while leaves memory when room is needed (it is
// evicted) and is made again from its record when it is opened.
//
// Thread-safe. Callbacks are called without a lock held, from the calling thread or from a worker.
class SessionRegistry {
 public:
  using CancelFlag = SessionWaiter::CancelFlag;
  using SessionCallback = std::function<void(absl::StatusOr<std::shared_ptr<Session>>)>;
  using StatusCallback = std::function<void(absl::Status)>;

  using Event = SessionEvent;
  using Observer = SessionObserver;
  static constexpr std::chrono::seconds kInUse = SessionEvictor::kInUse;

  // A session as it is kept, and itself while it is in memory.
  struct View {
    SessionRecord record;
    std::shared_ptr<Session> session;  // null: in the store only
  };
  struct ViewPage {
    std::vector<View> views;
    std::string next;  // SessionStore::Page::next
  };

  // All pointers must outlive the registry and all its sessions.
  // `ownership` says which sessions of the store this server may answer and write.
  SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget, WorkerPool* pool,
                  SessionStore* store, MeshCatalog* catalog, const Clock* clock = Clock::System(),
                  SessionOwnership* ownership = SoleOwnership::Get());
  ~SessionRegistry() { Stop(); }
  SessionRegistry(const SessionRegistry&) = delete;
  SessionRegistry& operator=(const SessionRegistry&) = delete;

  // Told of every event, from any thread, without a lock held. Call it before anything else.
  void set_observer(Observer observer) { observer_ = std::move(observer); }

  // How many sessions one owner with a name may have; 0: no limit of its own. Call it before
  // anything else.
  void set_most_of_owner(int most) { makings_.set_most_of_owner(most); }

  // `named` gives what Create and Open refuse with, with the server that has room where one is
  // known; where several share a store. Call it before anything else.
  void set_naming_room(std::function<absl::Status(const absl::Status&)> named) {
    naming_room_ = std::move(named);
  }

  // Learns which sessions the store has. Call it before anything else; blocks. Errors: those of
  // SessionStore::List.
  absl::Status LearnKnown() { return news_.LearnKnown(); }

  // What others do in a store that is shared (see StoreSync). Who does not know a session asks
  // the store before it is refused; so these may come late.
  void OnCreated(const SessionRecord& record) { news_.OnCreated(record); }  // it was created
  void Changed(const SessionRecord& record) { news_.Changed(record); }      // it was updated
  void Forget(const std::string& id) { endings_.Gone(id); }                 // it was deleted

  // This server does not hold the session any longer: it leaves memory, and what streams and
  // watches there are of it are told (Event::kMoved). Nothing where it has been taken anew since.
  // Who waits for it to be made from its record hears so, too.
  void Lost(const std::string& id);

  // The end of a server whose store is shared: takes no session any more, and gives those that it
  // holds to others, one after the other: its streams and watches end (Event::kMoved), commits
  // under way are waited for, its lease is given back. Blocks, until `deadline` and a call to the
  // store; leases that are left run out.
  void HandOver(std::chrono::steady_clock::time_point deadline);

  // Makes a session of `record` on a worker, keeps the record and calls `done` once. A record
  // without id gets a random one. Calls with the same request id share one session; its making
  // stops early when `cancelled` is set for all who wait for it. `mesh` is the one that the record
  // names. `tell` hears how far it is, also who joins later.
  //
  // Every successful answer is a claim on the session, see Abandon.
  //
  // Errors: those of Session::Create and SessionStore::Create; AlreadyExists (the id is taken);
  // ResourceExhausted (too many sessions, of all or of the owner); InvalidArgument (the request id
  // belongs to another request); NotFound (the mesh was removed meanwhile); Cancelled.
  void Create(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
              CancelFlag cancelled, const SessionCallback& done, const TellSession& tell = {});

  // Gives the session, made again from its record where it is not in memory. At once where it is.
  //
  // Errors: NotFound; those of Session::Create, SessionLeaseTable::Take, SessionStore::Get and
  // MeshCatalog::Load; ResourceExhausted; Cancelled; Unavailable (SESSION_MOVED: it was lost while
  // it was made).
  void Open(const std::string& id, CancelFlag cancelled, const SessionCallback& done,
            const TellSession& tell = {});

  // Answers those callers of Create and Open at once with Cancelled who came with this flag and
  // still wait; what is made for nobody else stops at its next stage.
  void CancelWait(const CancelFlag& cancelled) { makings_.CancelWait(cancelled); }

  // Takes back one claim of a caller who never saw the answer of Create. The session ends with its
  // last claim.
  void Abandon(const std::shared_ptr<Session>& session) { endings_.Abandon(session); }

  // In memory only. Errors: NotFound.
  absl::StatusOr<std::shared_ptr<Session>> Find(const std::string& id);

  // Without making it. Errors: NotFound, those of SessionStore::Get and List.
  void Look(const std::string& id, const std::function<void(absl::StatusOr<View>)>& done);
  void List(const SessionStore::ListRequest& request,
            const std::function<void(absl::StatusOr<ViewPage>)>& done);

  // Prepares the session anew from its record as `change` leaves it, then puts that into the place
  // of the old one, which closes as updated. The name, and where the handles' names and their order
  // stay also the committed poses, are kept; other handles begin at rest. `etag` is that of the
  // version that is changed; empty: whatever it is. `done` gets the session when its new record is
  // durable as far as the store is; after an error it is as it was.
  //
  // Errors: NotFound; Aborted (another version, or somebody else was faster); those of
  // SessionFactory::Remake and SessionStore::Update; ResourceExhausted; Cancelled; Unavailable
  // (SESSION_MOVED: another server holds it).
  void Update(const std::string& id, const std::string& etag, SessionFactory::Change change,
              CancelFlag cancelled, const std::function<void(absl::StatusOr<View>)>& done,
              TellSession tell = {});

  // Keeps the poses as the session's last ones; `done` when they are durable as far as the store
  // is; it does not call the registry. Errors: those of PoseCommits::Commit.
  void CommitPoses(std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
                   StatusCallback done) {
    commits_.Commit(std::move(session), std::move(poses), std::move(done));
  }

  // Calls `done` when the memory of the session is free and its record is gone. Errors: NotFound,
  // those of SessionLeaseTable::Take and SessionStore::Delete.
  void Delete(const std::string& id, const StatusCallback& done);

  // Evicts sessions that are not in use, of one owner where one is given, those first that were
  // used longest ago, until `enough` or none is left. Returns how many.
  int Evict(const std::function<bool()>& enough, const std::optional<std::string>& owner = {}) {
    return endings_.Evict(enough, owner);
  }

  // What Evict would give back at most.
  int64_t EvictableBytes() const { return endings_.EvictableBytes(); }

  // Ends the sessions that were idle for longer than the TTL, records and all: for stores in
  // memory, whose meshes nobody else keeps. Returns how many.
  int RemoveIdle() { return endings_.RemoveIdle(); }

  // What was used after `since`, or is held by an open stream: sessions, and what they are made of.
  struct Use {
    std::vector<std::string> sessions;
    std::vector<std::string> meshes;
  };
  Use UsedSince(Clock::TimePoint since) const;
  // Ends those of the sessions that were not used since, and that no stream holds, records and all.
  // Returns how many. Blocks where the store is shared; what others hold there stays.
  int RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since) {
    return endings_.RemoveUnused(ids, since);
  }
  // In memory or not.
  bool Knows(const std::string& id) const;

  // Takes the mesh out of the catalog, where that can have it again for no session: while it goes
  // no session of it is begun. Blocks on the disk. Errors: FailedPrecondition (sessions are made
  // from it, are being made or are not deleted to the end), those of MeshCatalog::Remove.
  absl::Status RemoveMesh(const std::string& sha256) { return endings_.RemoveMesh(sha256); }

  // Nothing is posted to the pool any longer: what the store answers from now on finds nobody who
  // waits. Call it before the pool ends, and end the store's calls before the registry.
  void Stop() {
    holds_->Stop();
    maker_.Stop();
  }

  // In memory.
  std::vector<std::shared_ptr<Session>> Loaded() const;
  int size() const;
  // In memory or not.
  int CountKnown() const;
  // In memory or not, those that are being made and those whose record is not gone yet.
  int CountMadeFrom(const std::string& mesh_sha256) const;

  WorkerPool& pool() { return *pool_; }

 private:
  using Ask = void (StoreSync::*)(const std::string&, const std::function<void(absl::Status)>&);

  SessionCallback NamingRoom(const SessionCallback& done) const;
  // `then` when a session that is there is known; `refuse` when that cannot be found out.
  void WhenKnown(const std::string& id, Ask ask, const std::function<void()>& then,
                 const StatusCallback& refuse);
  void StartUpdate(const std::string& id, const std::string& etag,
                   const SessionFactory::Change& change, const SessionCaller& caller,
                   const std::function<void(absl::StatusOr<View>)>& done);
  // Puts an updated session into its place. Errors: NotFound.
  absl::Status Replace(const SessionFactory::Made& remade, bool other_handles)
      ABSL_LOCKS_EXCLUDED(sessions_.mutex);
  std::shared_ptr<Session> Loaded(const std::string& id) ABSL_LOCKS_EXCLUDED(sessions_.mutex);

  // Constant.
  WorkerPool* const pool_;
  SessionStore* const store_;
  const Clock* const clock_;
  Observer observer_ = [](const std::string& /*id*/, Event /*event*/) {};
  std::function<absl::Status(const absl::Status&)> naming_room_;  // empty: nobody else has any

  // Self-synchronised. Sessions end before what they were made with.
  const std::shared_ptr<SessionLeaseTable> holds_;
  SessionFactory maker_;
  SharedSessionTable sessions_;
  SessionEvictor endings_;
  SessionLoader makings_;
  PoseCommits commits_;
  SessionUpdates updates_;
  StoreSync news_;
};

}  // namespace tissueform
