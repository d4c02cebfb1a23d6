// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/store/session_store.h"

namespace tissueform {

// Nothing outlives the process. Every call is answered before it returns.
class InMemorySessionStore : public SessionStore {
 public:
  explicit InMemorySessionStore(UnixClock clock = SystemUnixSeconds) : clock_(std::move(clock)) {}

  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void Get(const std::string& id, RecordCallback done) override;
  void Peek(const std::string& id, RecordCallback done) override { Get(id, std::move(done)); }
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override;
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override;
  void List(const ListRequest& request, PageCallback done) override;
  void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) override;
  void ListUnused(int64_t before_s, int limit, PageCallback done) override;

 private:
  // Whether a write to `id` made from version `etag` is allowed.
  absl::Status CheckWrite(const std::string& id, const std::string& etag, int64_t epoch) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Keeps the record as its next version.
  SessionRecord Keep(SessionRecord record, int64_t epoch) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const UnixClock clock_;

  Mutex mutex_;
  std::map<std::string, SessionRecord> records_ ABSL_GUARDED_BY(mutex_);
  int64_t last_version_ ABSL_GUARDED_BY(mutex_) = 0;  // of all records: an etag never comes again
};

}  // namespace tissueform
