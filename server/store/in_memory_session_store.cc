// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/in_memory_session_store.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "server/store/store_errors.h"

namespace tissueform {

void InMemorySessionStore::Create(SessionRecord record, int64_t epoch, RecordCallback done) {
  absl::StatusOr<SessionRecord> result = absl::InvalidArgumentError("a session record needs an id");
  if (!record.id.empty()) {
    MutexLock lock(mutex_);
    if (records_.find(record.id) == records_.end()) {
      record.created_s = clock_();
      record.last_used_s = 0;
      result = Keep(std::move(record), epoch);
    } else {
      result = SessionExists(record.id);
    }
  }
  done(std::move(result));
}

void InMemorySessionStore::Get(const std::string& id, RecordCallback done) {
  absl::StatusOr<SessionRecord> result = NoSession(id);
  {
    MutexLock lock(mutex_);
    if (const auto found = records_.find(id); found != records_.end()) {
      result = found->second;
    }
  }
  done(std::move(result));
}

void InMemorySessionStore::Update(SessionRecord record, int64_t epoch, RecordCallback done) {
  absl::StatusOr<SessionRecord> result;
  {
    MutexLock lock(mutex_);
    // A record without an etag was not read from here.
    const std::string etag = record.etag.empty() ? "none" : record.etag;
    const absl::Status status = CheckWrite(record.id, etag, epoch);
    if (status.ok()) {
      const SessionRecord& before = records_[record.id];
      record.created_s = before.created_s;
      record.last_used_s = before.last_used_s;
      result = Keep(std::move(record), epoch);
    } else {
      result = status;
    }
  }
  done(std::move(result));
}

void InMemorySessionStore::CommitPoses(const std::string& id, std::vector<HandlePose> poses,
                                       int64_t epoch, StatusCallback done) {
  absl::Status status;
  {
    MutexLock lock(mutex_);
    status = CheckWrite(id, "", epoch);
    if (status.ok()) status = CheckPoseCount(id, poses.size(), records_[id].handles.size());
    if (status.ok()) {
      SessionRecord& record = records_[id];
      record.last_poses = std::move(poses);
      record.epoch = epoch;
      record.last_used_s = std::max(record.last_used_s, clock_());
    }
  }
  done(std::move(status));
}

void InMemorySessionStore::Delete(const std::string& id, const std::string& etag, int64_t epoch,
                                  StatusCallback done) {
  absl::Status status;
  {
    MutexLock lock(mutex_);
    status = CheckWrite(id, etag, epoch);
    if (status.ok()) {
      records_.erase(id);
    }
  }
  done(std::move(status));
}

void InMemorySessionStore::List(const ListRequest& request, PageCallback done) {
  if (request.limit < 1) {
    done(BadLimit(request.limit));
    return;
  }
  Page page;
  {
    MutexLock lock(mutex_);
    for (auto next = records_.upper_bound(request.after); next != records_.end(); ++next) {
      const bool wanted = !request.owner.has_value() || next->second.owner == *request.owner ||
                          request.also.contains(next->first);
      if (!wanted) continue;
      if (page.records.size() == static_cast<size_t>(request.limit)) {
        page.next = page.records.back().id;
        break;
      }
      page.records.push_back(next->second);
    }
  }
  done(std::move(page));
}

void InMemorySessionStore::Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) {
  {
    MutexLock lock(mutex_);
    for (const std::string& id : ids) {
      if (const auto found = records_.find(id); found != records_.end()) {
        found->second.last_used_s = std::max(found->second.last_used_s, now_s);
      }
    }
  }
  done(absl::OkStatus());
}

void InMemorySessionStore::ListUnused(int64_t before_s, int limit, PageCallback done) {
  if (limit < 1) {
    done(BadLimit(limit));
    return;
  }
  Page page;
  {
    MutexLock lock(mutex_);
    for (const auto& [id, record] : records_) {
      if (record.last_used_s < before_s) page.records.push_back(record);
    }
  }
  std::stable_sort(
      page.records.begin(), page.records.end(),
      [](const SessionRecord& a, const SessionRecord& b) { return a.last_used_s < b.last_used_s; });
  if (page.records.size() > static_cast<size_t>(limit)) page.records.resize(limit);
  done(std::move(page));
}

absl::Status InMemorySessionStore::CheckWrite(const std::string& id, const std::string& etag,
                                              int64_t epoch) const {
  const auto found = records_.find(id);
  if (found == records_.end()) return NoSession(id);
  return CheckSessionWrite(id, etag, epoch, found->second.etag, found->second.epoch);
}

SessionRecord InMemorySessionStore::Keep(SessionRecord record, int64_t epoch) {
  record.etag = absl::StrCat(++last_version_);
  record.epoch = epoch;
  record.last_used_s = std::max(record.last_used_s, clock_());
  return records_[record.id] = std::move(record);
}

}  // namespace tissueform
