// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/in_memory_session_store.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"

namespace tissueform {

void InMemorySessionStore::Create(SessionRecord record, int64_t epoch, RecordCallback done) {
  absl::StatusOr<SessionRecord> result = absl::InvalidArgumentError("a session record needs an id");
  if (!record.id.empty()) {
    MutexLock lock(mutex_);
    if (records_.find(record.id) == records_.end()) {
      result = Keep(std::move(record), epoch);
    } else {
      result = absl::AlreadyExistsError(
          absl::StrCat("a session \"", record.id, "\" exists already; choose another id"));
    }
  }
  done(std::move(result));
}

void InMemorySessionStore::Get(const std::string& id, RecordCallback done) {
  absl::StatusOr<SessionRecord> result =
      absl::NotFoundError(absl::StrCat("no record of session \"", id, "\""));
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
    result = status.ok() ? Keep(std::move(record), epoch) : absl::StatusOr<SessionRecord>(status);
  }
  done(std::move(result));
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
    done(absl::InvalidArgumentError(
        absl::StrCat("limit is ", request.limit, "; it must be at least 1")));
    return;
  }
  Page page;
  {
    MutexLock lock(mutex_);
    for (auto next = records_.upper_bound(request.after); next != records_.end(); ++next) {
      if (next->second.owner != request.owner) continue;
      if (page.records.size() == static_cast<size_t>(request.limit)) {
        page.next = page.records.back().id;
        break;
      }
      page.records.push_back(next->second);
    }
  }
  done(std::move(page));
}

absl::Status InMemorySessionStore::CheckWrite(const std::string& id, const std::string& etag,
                                              int64_t epoch) const {
  const auto found = records_.find(id);
  if (found == records_.end()) {
    return absl::NotFoundError(absl::StrCat("no record of session \"", id, "\""));
  }
  if (epoch < found->second.epoch) {
    return absl::FailedPreconditionError(absl::StrCat("epoch ", epoch, " of session \"", id,
                                                      "\" is over, it is ", found->second.epoch,
                                                      " now: another server has taken it"));
  }
  if (!etag.empty() && etag != found->second.etag) {
    return WithReason(
        absl::AbortedError(
            absl::StrCat("session \"", id, "\" has changed in the meantime; get it and try again")),
        ErrorReason::kStaleEtag);
  }
  return absl::OkStatus();
}

SessionRecord InMemorySessionStore::Keep(SessionRecord record, int64_t epoch) {
  record.etag = absl::StrCat(++last_version_);
  record.epoch = epoch;
  return records_[record.id] = std::move(record);
}

}  // namespace tissueform
