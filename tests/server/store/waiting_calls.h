// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/store/session_store.h"

// Calls of a SessionStore that wait for their answer.
namespace tissueform {

template <typename Answer, typename Call>
Answer WaitFor(Call call) {
  auto promise = std::make_shared<std::promise<Answer>>();
  auto future = promise->get_future();
  call([promise](Answer answer) { promise->set_value(std::move(answer)); });
  return future.get();
}

inline absl::StatusOr<SessionRecord> CreateSession(SessionStore& store, const SessionRecord& record,
                                                   int64_t epoch = 1) {
  return WaitFor<absl::StatusOr<SessionRecord>>(
      [&](auto done) { store.Create(record, epoch, done); });
}

inline absl::StatusOr<SessionRecord> GetSession(SessionStore& store, const std::string& id) {
  return WaitFor<absl::StatusOr<SessionRecord>>([&](auto done) { store.Get(id, done); });
}

inline absl::StatusOr<SessionRecord> UpdateSession(SessionStore& store, const SessionRecord& record,
                                                   int64_t epoch = 1) {
  return WaitFor<absl::StatusOr<SessionRecord>>(
      [&](auto done) { store.Update(record, epoch, done); });
}

inline absl::Status CommitPoses(SessionStore& store, const std::string& id,
                                const std::vector<HandlePose>& poses, int64_t epoch = 1) {
  return WaitFor<absl::Status>([&](auto done) { store.CommitPoses(id, poses, epoch, done); });
}

inline absl::Status DeleteSession(SessionStore& store, const std::string& id,
                                  const std::string& etag = "", int64_t epoch = 1) {
  return WaitFor<absl::Status>([&](auto done) { store.Delete(id, etag, epoch, done); });
}

inline absl::StatusOr<SessionStore::Page> ListSessions(SessionStore& store,
                                                       const SessionStore::ListRequest& request) {
  return WaitFor<absl::StatusOr<SessionStore::Page>>([&](auto done) { store.List(request, done); });
}

}  // namespace tissueform
