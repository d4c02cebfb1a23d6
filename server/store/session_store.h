// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/session_record.h"

namespace tissueform {

// For Create in a store that several servers share: the store gives an epoch itself, greater than
// every one that it has given before. So a server that has lost a session writes nothing of the
// next one of the same id either.
inline constexpr int64_t kFreshEpoch = 0;

// Where session records are kept. tests/server/store/session_store_contract_test.cc is the contract
// in full; every store passes it.
//
// Asynchronous: a call returns at once or soon, and `done` is called exactly once, from the calling
// thread or another, without a lock of the store held. What `done` has said is durable as far as
// the store is. Records are values: a change to one copy changes no other.
//
// Two writers cannot overwrite each other: an update names the etag of the version that it was made
// from. A writer who no longer owns a session cannot write to it: every write carries an epoch, and
// one that is lower than that of the last write is refused (a node that takes a session over writes
// under a higher one). A record that was deleted leaves no epoch behind (but see kFreshEpoch).
//
// Thread-safe. Must outlive its calls.
class SessionStore {
 public:
  using RecordCallback = std::function<void(absl::StatusOr<SessionRecord>)>;
  using StatusCallback = std::function<void(absl::Status)>;

  struct Page {
    std::vector<SessionRecord> records;  // by id, rising
    std::string next;                    // give it as `after`; empty: that was all
  };
  using PageCallback = std::function<void(absl::StatusOr<Page>)>;

  struct ListRequest {
    std::optional<std::string> owner = {};  // of this one only; unset: of all
    std::set<std::string> also = {};        // ids of others, where an owner is set
    std::string after = {};                 // ids greater than this
    int limit = 100;                        // at least 1
  };

  virtual ~SessionStore() = default;

  // Adds a record; `done` gets it with its etag and epoch.
  // Errors: InvalidArgument (no id), AlreadyExists; NotFound where the store is shared and the mesh
  // was deleted by another server.
  virtual void Create(SessionRecord record, int64_t epoch, RecordCallback done) = 0;

  // Of what was asked for this id before, all is in it. Errors: NotFound.
  virtual void Get(const std::string& id, RecordCallback done) = 0;

  // As Get, for who had better ask another server than wait for this one's store: behind nothing
  // that was asked before, which the record may lack, and for 2 s at most.
  virtual void Peek(const std::string& id, RecordCallback done) = 0;

  // Replaces the record of this id, if record.etag is still its etag; `done` gets it with its new
  // one. Errors: NotFound, FailedPrecondition (the epoch is older), Aborted (the etag is another;
  // get the record and try again). Tried in this order.
  virtual void Update(SessionRecord record, int64_t epoch, RecordCallback done) = 0;

  // Replaces last_poses of this record and nothing else: the etag stays, so that a drag does not
  // make the copies of others stale. Cheap enough for every end of a drag (one small row).
  // Errors: NotFound, FailedPrecondition (the epoch is older), InvalidArgument (neither none nor
  // one pose a handle). Tried in this order.
  virtual void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                           StatusCallback done) = 0;

  // Deletes any version when `etag` is empty. Errors: those of Update.
  virtual void Delete(const std::string& id, const std::string& etag, int64_t epoch,
                      StatusCallback done) = 0;

  // Errors: InvalidArgument (limit).
  virtual void List(const ListRequest& request, PageCallback done) = 0;

  // Says that these are in use, all in one write; ids that are not there do not count. A record's
  // last_used_s never goes back, even if the clock does.
  virtual void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) = 0;

  // Records of all owners that were last used before that time, longest unused first, up to `limit`
  // of them; `next` stays empty. Errors: InvalidArgument (limit).
  virtual void ListUnused(int64_t before_s, int limit, PageCallback done) = 0;
};

// Where a store takes the time from: unix seconds. Any thread may call it.
using UnixClock = std::function<int64_t()>;
int64_t SystemUnixSeconds();

}  // namespace tissueform
