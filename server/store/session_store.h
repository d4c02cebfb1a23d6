// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/session_record.h"

namespace tissueform {

// Where session records are kept. tests/server/store/session_store_contract_test.cc is the contract
// in full; every store passes it.
//
// Asynchronous: a call returns at once or soon, and `done` is called exactly once, from the calling
// thread or another, without a lock of the store held. What `done` has said is durable as far as
// the store is. Records are values: nobody sees another's changes to a copy.
//
// Two writers cannot overwrite each other: an update names the etag of the version that it was made
// from. A writer who no longer owns a session cannot write to it: every write carries an epoch, and
// one that is lower than that of the last write is refused (a node that takes a session over writes
// under a higher one). A record that was deleted leaves no epoch behind.
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
    std::string owner;  // of this one only, the anonymous one when empty
    std::string after;  // ids greater than this
    int limit = 100;    // at least 1
  };

  virtual ~SessionStore() = default;

  // Adds a record; `done` gets it with its etag and epoch.
  // Errors: InvalidArgument (no id), AlreadyExists.
  virtual void Create(SessionRecord record, int64_t epoch, RecordCallback done) = 0;

  // Errors: NotFound.
  virtual void Get(const std::string& id, RecordCallback done) = 0;

  // Replaces the record of this id, if record.etag is still its etag; `done` gets it with its new
  // one. Errors: NotFound, FailedPrecondition (the epoch is older), Aborted (the etag is another;
  // get the record and try again). Tried in this order.
  virtual void Update(SessionRecord record, int64_t epoch, RecordCallback done) = 0;

  // Whatever its etag when `etag` is empty. Errors: those of Update.
  virtual void Delete(const std::string& id, const std::string& etag, int64_t epoch,
                      StatusCallback done) = 0;

  // Errors: InvalidArgument (limit).
  virtual void List(const ListRequest& request, PageCallback done) = 0;
};

}  // namespace tissueform
