// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/session.h"
#include "server/session/session_progress.h"
#include "server/store/session_record.h"

namespace tissueform {

// What makes a creation idempotent: the same id again with the same fingerprint is the same
// request.
struct RequestKey {
  std::string request_id;  // empty: none
  std::string fingerprint;
};
// Whose request ids are apart from everybody else's.
inline RequestKey RequestKeyOf(const SessionRecord& record) {
  if (record.request_id.empty() || record.owner.empty()) {
    return {record.request_id, record.request_fingerprint};
  }
  return {record.owner + "\n" + record.request_id, record.request_fingerprint};
}

// Somebody who waits for a session.
struct SessionWaiter {
  using CancelFlag = std::shared_ptr<const std::atomic<bool>>;

  CancelFlag cancelled;
  std::function<void(absl::StatusOr<std::shared_ptr<Session>>)> done;
  TellSession tell = nullptr;  // may be empty
  bool claims = false;         // a successful answer is one more claim on a session that is known
};

// A session that is being made, or made again from its record.
struct PendingSession {
  std::string id;
  RequestKey key;
  std::string owner;  // empty: nobody with a name
  std::string mesh_sha256;
  bool restores = false;
  int version = 0;  // of what it is made from
  // Guarded by the owner of the table.
  std::vector<SessionWaiter> waiters;
  std::optional<SessionProgress> newest = std::nullopt;

  // Whether somebody waits for it who has not cancelled.
  bool wanted() const;
};

// A session that the server knows.
struct SessionEntry {
  std::shared_ptr<Session> session;  // null: it is in the store only
  RequestKey key;
  std::string owner = {};  // empty: nobody with a name
  std::string mesh_sha256;
  int version = 0;                              // how often it was updated
  int claims = 1;                               // who has seen its name
  Clock::TimePoint last_used;                   // while there is no session
  std::vector<std::weak_ptr<Session>> evicted;  // what it was before; whoever holds one comes back
  std::shared_ptr<const StoredMesh> mesh;       // while there is none: what could not be read again
};

// Which sessions there are, which are being made, who waits for them, and which are on their way
// out. No threads, no store: those who share it (SharedSessionTable) guard it and act.
class SessionTable {
 public:
  using PendingSessionPtr = std::shared_ptr<PendingSession>;

  // Null where there is none.
  SessionEntry* Find(const std::string& id);
  const SessionEntry* Find(const std::string& id) const;
  SessionEntry* FindRequest(const std::string& request_id);
  // Empty where there is none.
  std::string IdOfRequest(const std::string& request_id) const;
  PendingSessionPtr FindMaking(const std::string& id) const;
  PendingSessionPtr FindMakingOfRequest(const std::string& request_id) const;

  // REQUIRES: the id is not known.
  void Add(const std::string& id, SessionEntry known);
  // Empty when it is not known. Whoever takes a session ends it; until that is told by Ended its id
  // is not free.
  std::optional<SessionEntry> Take(const std::string& id);
  // One that has been made and never was in the table: as if taken.
  void TakeUnknown(const std::string& id, const std::string& mesh_sha256) {
    ending_.emplace(id, mesh_sha256);
  }
  void Ended(const std::string& id) { ending_.erase(id); }
  bool IsEnding(const std::string& id) const { return ending_.contains(id); }

  // Between the two nobody should begin a session of that mesh.
  void BeginRemoval(const std::string& mesh_sha256) { leaving_meshes_.insert(mesh_sha256); }
  void EndRemoval(const std::string& mesh_sha256) {
    leaving_meshes_.erase(leaving_meshes_.find(mesh_sha256));
  }
  bool IsLeaving(const std::string& mesh_sha256) const {
    return leaving_meshes_.contains(mesh_sha256);
  }

  PendingSessionPtr StartMaking(std::string id, RequestKey key, std::string owner,
                                std::string mesh_sha256, bool restores, SessionWaiter waiter);
  // Those who still wait for it. REQUIRES: under way.
  std::vector<SessionWaiter> EndMaking(const PendingSessionPtr& making);
  // Whoever came with this flag and still waits, taken out.
  std::vector<SessionWaiter> TakeWaiters(const SessionWaiter::CancelFlag& cancelled);

  // Of those in memory, or of this owner's where one is given, the one that was used longest ago,
  // unless that is after `before` or something is being made for it. Empty when there is none.
  std::string LeastRecentlyUsed(Clock::TimePoint before,
                                const std::optional<std::string>& owner) const;
  // The memory of those that LeastRecentlyUsed names one after the other when they leave; what
  // several share goes with the last of them.
  int64_t BytesUnusedSince(Clock::TimePoint before) const;
  // Of this owner: those that are known, and those that are being made for the first time.
  int CountOf(const std::string& owner) const;
  // Of all: those used last at `until` or before.
  std::vector<std::string> UnusedSince(Clock::TimePoint until) const;
  // Whether it is one of those.
  bool IsUnusedSince(const std::string& id, Clock::TimePoint until) const;

  // Of all: those that were used after `since`, and those that a stream holds or somebody waits
  // for.
  std::vector<std::string> InUse(Clock::TimePoint since) const;
  // False of one that is not known.
  bool IsInUse(const std::string& id, Clock::TimePoint since) const;

  // Also those that are being made and those that are ending.
  int CountMadeFrom(const std::string& mesh_sha256) const;

  // In memory, or on the way there.
  size_t num_loaded() const { return num_loaded_in_table() + makings_.size(); }
  size_t num_known() const { return known_.size(); }
  size_t num_loaded_in_table() const;
  std::vector<std::shared_ptr<Session>> Loaded() const;

 private:
  bool IsInUse(const std::string& id, const SessionEntry& known, Clock::TimePoint since) const;
  bool IsUnused(const std::string& id, const SessionEntry& known, Clock::TimePoint until) const;

  std::map<std::string, SessionEntry> known_;              // by id
  std::map<std::string, std::string> session_of_request_;  // request id: id
  std::vector<PendingSessionPtr> makings_;
  std::map<std::string, std::string> ending_;  // id: mesh
  std::multiset<std::string> leaving_meshes_;
};

struct SharedSessionTable {
  mutable Mutex mutex;
  SessionTable table ABSL_GUARDED_BY(mutex);
};

}  // namespace tissueform
