// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_lease_table.h"
#include "server/store/session_record.h"

namespace tissueform {

// What happens to a session, for streams and watches that follow it.
// kMoved: this server no longer holds it.
enum class SessionEvent { kEvicted, kRestored, kDeleted, kMoved };
// From any thread, without a lock held.
using SessionObserver = std::function<void(const std::string& id, SessionEvent event)>;

// What makes a creation idempotent: the same id again with the same fingerprint is the same
// request.
struct RequestKey {
  std::string request_id;  // empty: none
  std::string fingerprint;
};
// Each owner has request ids of its own.
RequestKey RequestKeyOf(const SessionRecord& record);

// A session as it is kept, and itself while it is in memory.
struct SessionView {
  SessionRecord record;
  std::shared_ptr<Session> session;  // null: in the store only
};

// The state of every session that this server knows, by its id, and how sessions leave memory
// (eviction). It does not know which calls wait for a session (SessionLoader), and does not write
// records (StoreSync).
//
// An id is free, has a place (its session is being created), has an entry (the record is kept; the
// session is in memory or not), has both (it is being loaded), or is ending (the record is about to
// be deleted). An id that is not free cannot be created.
//
// Thread-safe. The order of locks: SessionLoader, SessionTable, then those of a session, of the
// mesh catalog, and of the lease table. No lock is held over a call of an observer, a store or
// Session::Close.
class SessionTable {
 public:
  // A session that was used within this time is not evicted. A server whose sessions are all in use
  // refuses new ones.
  static constexpr std::chrono::seconds kInUse{10};

  // All pointers must outlive it.
  SessionTable(const ServiceLimits& limits, MeshCatalog* catalog, SessionLeaseTable* leases,
               const Clock* clock)
      : limits_(limits), catalog_(catalog), leases_(leases), clock_(clock) {}
  SessionTable(const SessionTable&) = delete;
  SessionTable& operator=(const SessionTable&) = delete;

  // Hears of every event. Call it before anything else.
  void set_observer(SessionObserver observer) { observer_ = std::move(observer); }
  void Notify(const std::string& id, SessionEvent event) const { observer_(id, event); }

  // How many sessions one owner with a name may have; 0: no limit of its own. Call it before
  // anything else.
  void set_max_of_owner(int max) { max_of_owner_ = max; }

  // In memory only, and held by this server; counts as a use. Errors: NotFound.
  absl::StatusOr<std::shared_ptr<Session>> Find(const std::string& id);
  // Null when it is not in memory; counts as nothing.
  std::shared_ptr<Session> Peek(const std::string& id) const;
  // In memory or not.
  bool Knows(const std::string& id) const;
  // In memory.
  std::vector<std::shared_ptr<Session>> Loaded() const;
  int size() const;
  // In memory or not.
  std::vector<std::string> KnownIds() const;
  // Empty where it is not known, or has no owner with a name.
  std::string OwnerOf(const std::string& id) const;
  int CountKnown() const;
  // In memory or not, those that are being created and those whose record is not deleted yet.
  int CountMadeFrom(const std::string& mesh_sha256) const;

  // What was used after `since`, or is held by an open stream: sessions, and what they are made of.
  struct Use {
    std::vector<std::string> sessions;
    std::vector<std::string> meshes;
  };
  Use UsedSince(Clock::TimePoint since) const;

  // Evicts sessions that are not in use, of one owner where one is given, those first that were
  // used longest ago, until `enough` is true or there are no more. Returns how many.
  int Evict(const std::function<bool()>& enough, const std::optional<std::string>& owner = {});
  // What Evict would give back at most.
  int64_t EvictableBytes() const;
  // Evicts until there is room for one more session; false when there is still no room.
  bool MakeRoom();

  // Takes the mesh out of the catalog, where that can have it again for no session: while it goes
  // no session of it is begun. Blocks on the disk. Errors: FailedPrecondition (sessions are made
  // from it, are being made or are not deleted to the end), those of MeshCatalog::Remove.
  absl::Status RemoveMesh(const std::string& sha256);

  // This server may no longer answer the session: it leaves memory. Nothing where it has been
  // taken again since.
  void Lost(const std::string& id);

  // For SessionLoader, which calls these under its own lock. Between a Begin that gave a place and
  // its Finish the session counts as one in memory.

  // Gives a place to a session that is to be created. Errors: AlreadyExists, Unavailable (the id is
  // ending), ResourceExhausted (too many sessions, of all or of the owner), NotFound (the mesh).
  absl::Status BeginCreation(const SessionRecord& record);
  // Ends a creation: no session (null) frees the id. A session without claims is not wanted: its id
  // is ending.
  void FinishCreation(const std::string& id, const std::shared_ptr<Session>& created, int claims);

  // What became of a session that was asked for.
  struct Found {
    absl::Status refusal = absl::OkStatus();
    std::shared_ptr<Session> session = nullptr;  // where it is in memory
    std::shared_ptr<Session> lost = nullptr;     // give it to CloseLost without a lock
    bool loads_again = false;                    // of FinishLoading: it has kept its place
  };
  // Neither a refusal nor a session: it has a place, the caller's or an earlier one. `claims`: the
  // caller is one more claim if the session is in memory. Refusals: NotFound, ResourceExhausted.
  Found BeginLoading(const std::string& id, bool claims);
  // Ends the loading of a session, which gets so many new claims. The callers get what is found; if
  // that is not what was loaded, the loaded session is not needed. It is loaded again after an
  // update, and when it was canceled though a caller still waits (`wanted`). Refusals: that of
  // `loaded`; NotFound (it was deleted); SESSION_MOVED.
  Found FinishLoading(const std::string& id, const absl::StatusOr<std::shared_ptr<Session>>& loaded,
                      bool wanted, int claims);
  void CloseLost(const std::shared_ptr<Session>& lost) const;

  // Whether a session may be made a second time, for an update. Errors: NotFound,
  // ResourceExhausted.
  absl::Status CheckUpdate(const std::string& id) const;

  // The session that this request has created or is creating; its key distinguishes another request
  // with the same id.
  struct EarlierRequest {
    std::string session_id;
    RequestKey key;
  };
  std::optional<EarlierRequest> FindRequest(const std::string& request_id) const;

  // For StoreSync, which ends the sessions that it takes out, and their records. Until Ended the id
  // is not free.
  struct TakenSession {
    std::shared_ptr<Session> session;        // null: it was not in memory
    std::shared_ptr<const StoredMesh> mesh;  // goes without a lock
  };
  using Taken = std::optional<TakenSession>;

  // Empty where it is not known.
  Taken Take(const std::string& id);
  // Takes back one claim; true where that was the last one, and the session is taken.
  bool TakeAbandoned(const std::shared_ptr<Session>& session);
  // Its record is gone already: its id is free at once. Empty where it has a place.
  Taken TakeGone(const std::string& id);
  void Ended(const std::string& id);

  // Whether a stream that holds a session keeps it in use.
  enum class Streams { kCount, kIgnored };
  // Those that were not used after `since`.
  std::vector<std::string> Unused(Clock::TimePoint since) const;  // Streams::kIgnored
  bool IsUnused(const std::string& id, Clock::TimePoint since, Streams streams) const;
  Taken TakeUnused(const std::string& id, Clock::TimePoint since, Streams streams);

  // A session of the store that others may have created or changed; what this server holds, makes
  // or ends it knows better.
  void Learn(const SessionRecord& record);
  // Puts an updated session whose record is kept into the place of the one before, which closes.
  // Errors: NotFound.
  absl::Status Replace(const SessionView& updated, bool other_handles);

 private:
  struct Entry {
    std::shared_ptr<Session> session;  // null: it is in the store only
    RequestKey key;
    std::string owner;  // empty: anonymous
    std::string mesh_sha256;
    int version = 0;                                   // how often it was updated
    int claims = 1;                                    // callers that know its name
    Clock::TimePoint last_used = {};                   // while there is no session
    std::vector<std::weak_ptr<Session>> evicted = {};  // earlier ones; their holders open it again
    std::shared_ptr<const StoredMesh> mesh = {};  // while there is no session: cannot be read again
  };
  // Of a session that is being created or loaded.
  struct Place {
    bool creates = false;
    int version = 0;  // of what is loaded
    // Of what is created.
    RequestKey key = {};
    std::string owner = {};
    std::string mesh_sha256 = {};
  };

  const Entry* FindEntry(const std::string& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Entry* FindEntry(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Add(const std::string& id, Entry entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Taken TakeEntry(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ForgetRequest(const RequestKey& key, const std::string& id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::shared_ptr<Session> Unload(Entry* entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Its session, out of the table, where this server does not hold it; else null.
  std::shared_ptr<Session> UnloadIfLost(Entry* entry) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::shared_ptr<Session> EvictOldest(const std::optional<std::string>& owner)
      ABSL_LOCKS_EXCLUDED(mutex_);
  Entry* LeastRecentlyUsed(Clock::TimePoint before, const std::optional<std::string>& owner)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool IsUnusedEntry(const std::string& id, const Entry& entry, Clock::TimePoint since,
                     Streams streams) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckQuota(const std::string& owner) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckMesh(const std::string& sha256) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckRoom() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool Full() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int CountLoaded() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int CountOf(const std::string& mesh_sha256) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Constant once requests are served.
  const ServiceLimits limits_;
  MeshCatalog* const catalog_;
  SessionLeaseTable* const leases_;
  const Clock* const clock_;
  int max_of_owner_ = 0;  // 0: no limit
  SessionObserver observer_ = [](const std::string& /*id*/, SessionEvent /*event*/) {};

  mutable Mutex mutex_;
  std::map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);         // by id
  std::map<std::string, Place> places_ ABSL_GUARDED_BY(mutex_);          // by id
  std::map<std::string, std::string> ending_ ABSL_GUARDED_BY(mutex_);    // id: mesh
  std::map<std::string, std::string> requests_ ABSL_GUARDED_BY(mutex_);  // request id: id
  std::multiset<std::string> leaving_meshes_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
