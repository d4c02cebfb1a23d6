// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/session.h"
#include "server/session/session_lease_table.h"
#include "server/session/session_table.h"
#include "server/store/session_record.h"
#include "server/store/session_store.h"

namespace tissueform {

struct SessionViewPage {
  std::vector<SessionView> views;
  std::string next;  // SessionStore::Page::next
};

// Keeps the table of sessions and their records in step: reads and deletes records, writes poses
// and updates, and follows a store that other servers write to.
//
// Thread-safe. Its lock is for the order of writes only, and is held over no call of another class
// but Session's. Callbacks come without a lock, from the calling thread or another.
class StoreSync {
 public:
  using StatusCallback = std::function<void(absl::Status)>;
  using ViewCallback = std::function<void(absl::StatusOr<SessionView>)>;

  // All must outlive it and its calls.
  StoreSync(const ServiceLimits& limits, SessionTable* table, SessionStore* store,
            SessionLeaseTable* leases, const Clock* clock)
      : limits_(limits), table_(table), store_(store), leases_(leases), clock_(clock) {}
  StoreSync(const StoreSync&) = delete;
  StoreSync& operator=(const StoreSync&) = delete;

  // Without loading it. Errors: NotFound, those of SessionStore::Get and List.
  void Look(const std::string& id, const ViewCallback& done);
  void List(const SessionStore::ListRequest& request,
            const std::function<void(absl::StatusOr<SessionViewPage>)>& done);

  // Learns which sessions the store has. Call it before anything else; blocks. Errors: those of
  // SessionStore::List.
  absl::Status LearnAll();
  // What others do in a store that is shared. Reports may come late, twice, or be of what this
  // server has done itself.
  void OnChanged(const SessionRecord& record) { table_->Learn(record); }  // or created
  void OnDeleted(const std::string& id);
  // `then` with OK once the table knows the session if there is one: the store is asked when it is
  // shared and the session is not known. kBrief: for at most 2 s (SessionStore::Peek), where the
  // caller may ask another server. Errors: those of the store but NotFound.
  enum class Patience { kBrief, kFull };
  void WhenKnown(const std::string& id, Patience patience, const StatusCallback& then);

  // Keeps the poses, one for every handle of the session, as its last ones; `done` when they are
  // durable as far as the store is. Each commit comes before an update of its session or after it:
  // never between its reading and its writing, where it would be lost. `done` updates no session.
  //
  // Errors: Aborted (the session has other handles now), Unavailable (SESSION_MOVED), those of
  // SessionStore::CommitPoses.
  void CommitPoses(std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
                   StatusCallback done) ABSL_LOCKS_EXCLUDED(mutex_);
  // Until the store has answered all commits of the session, or then.
  void WaitForCommits(const std::string& id, std::chrono::steady_clock::time_point deadline)
      ABSL_LOCKS_EXCLUDED(mutex_);

  // Keeps the record of an updated session if no other update was faster, and puts the session into
  // the table. Committed poses stay where the handles' names and their order do. After an error the
  // updated session is gone before `done` comes.
  //
  // Errors: NotFound, those of SessionStore::Update, SESSION_MOVED.
  void KeepUpdate(SessionView updated, ViewCallback done) ABSL_LOCKS_EXCLUDED(mutex_);

  // Calls `done` when the memory of the session is free and its record is deleted. Errors:
  // NotFound, those of SessionLeaseTable::Take and SessionStore::Delete.
  void Delete(const std::string& id, const StatusCallback& done);
  // Takes back one claim of a caller who never saw the answer of SessionLoader::Create. The session
  // ends with its last claim.
  void Abandon(const std::shared_ptr<Session>& session);
  // Ends a session that is out of the table, and its record; no caller waits for that.
  void EndUnwanted(const std::shared_ptr<Session>& session);

  // Ends the sessions that were idle for longer than the TTL, records and all: for stores in
  // memory, whose meshes are kept nowhere else. Returns how many.
  int RemoveIdle();
  // Ends those of the sessions that were not used since, and that no stream holds, records and all.
  // Returns how many. Blocks where the store is shared; what others hold there stays.
  int RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since);

 private:
  // The writes of one session that are under way.
  struct Writes {
    int updates = 0;
    int handing_over = 0;                        // commits: the store has not got them yet
    int unanswered = 0;                          // commits
    std::vector<std::function<void()>> waiting;  // commits, for the updates to end
  };

  // Before the store reads the record that is to be updated, and after it has written it.
  void BeginUpdate(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void EndUpdate(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void WriteUpdate(SessionView updated, const absl::StatusOr<SessionRecord>& current,
                   const ViewCallback& done);
  void EraseIfIdle(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  void DeleteHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                  const StatusCallback& done);
  // Frees its memory, which may have to wait; then the rest.
  static void End(const std::shared_ptr<Session>& session, const std::function<void()>& then);
  // Deletes the record of a session that has ended; then its id is free again. Erase does so also
  // where this server no longer holds it: the store refuses if another has taken it.
  void EraseIfHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                   const StatusCallback& done);
  void Erase(const std::string& id, const SessionLeaseHandlePtr& hold, const StatusCallback& done);
  void OnErased(const std::string& id, const SessionLeaseHandlePtr& hold,
                const absl::Status& outcome, const StatusCallback& done);
  int EndUnused(const std::vector<std::string>& ids, Clock::TimePoint since,
                SessionTable::Streams streams);

  const ServiceLimits limits_;
  SessionTable* const table_;
  SessionStore* const store_;
  SessionLeaseTable* const leases_;
  const Clock* const clock_;

  Mutex mutex_;
  ConditionVariable fewer_;
  std::map<std::string, Writes> writes_ ABSL_GUARDED_BY(mutex_);  // by id
};

}  // namespace tissueform
