// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/postgres_store/session_leases.h"

// What leases are, in memory and on a clock that stands still until it is set: what PostgreSQL is
// compared with, and a store for tests of what uses leases.
namespace tissueform::testing {

struct ModelStore {
  struct Session {
    int64_t epoch = 2;  // the first that is given
    std::string holder = {};
    std::string node = {};
    std::chrono::steady_clock::time_point lease_until = {};
  };

  // A write under this epoch is kept.
  bool Commits(const std::string& session, int64_t epoch) {
    const auto found = sessions.find(session);
    return found != sessions.end() && epoch >= found->second.epoch;
  }
  // Greater than every one before, of any session.
  int64_t NextEpoch() { return ++newest_epoch; }

  std::chrono::steady_clock::time_point now{std::chrono::hours(1)};
  std::map<std::string, Session> sessions = {};
  int64_t newest_epoch = Session().epoch;
  absl::Status failure = {};  // of all calls, which change nothing then
  // So much time passes between when the next call is made and when it is done.
  std::chrono::milliseconds next_delay{0};
};

class ModelLeases final : public SessionLeases {
 public:
  ModelLeases(ModelStore* store, std::string holder, LeaseOptions options = {})
      : store_(store), holder_(std::move(holder)), options_(options) {}

  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override {
    if (!store_->failure.ok()) return store_->failure;
    const auto asked = Ask();
    const auto found = store_->sessions.find(session);
    if (found == store_->sessions.end()) return absl::NotFoundError("no session");
    ModelStore::Session& row = found->second;
    const bool free = row.lease_until <= store_->now;
    if (!free && row.holder != holder_) return LeaseAnswer{.node = row.node};
    if (free) row.epoch = store_->NextEpoch();
    row.holder = holder_;
    row.node = holder_;
    return LeaseAnswer{.mine = true, .lease = Begin(asked, session, &row)};
  }

  absl::StatusOr<std::vector<SessionLease>> Renew() override {
    if (!store_->failure.ok()) return store_->failure;
    const auto asked = Ask();
    std::vector<SessionLease> leases;
    for (auto& [session, row] : store_->sessions) {
      if (row.holder == holder_ && row.lease_until > store_->now) {
        leases.push_back(Begin(asked, session, &row));
      }
    }
    return leases;
  }

  absl::Status Release(const std::string& session, int64_t epoch) override {
    if (!store_->failure.ok()) return store_->failure;
    const auto found = store_->sessions.find(session);
    if (found != store_->sessions.end() && found->second.holder == holder_ &&
        found->second.epoch == epoch) {
      found->second.lease_until = {};
    }
    return absl::OkStatus();
  }

 private:
  // When it was; now it is done.
  std::chrono::steady_clock::time_point Ask() {
    const auto asked = store_->now;
    store_->now += std::exchange(store_->next_delay, {});
    return asked;
  }
  SessionLease Begin(std::chrono::steady_clock::time_point asked, const std::string& session,
                     ModelStore::Session* row) {
    row->lease_until = store_->now + options_.duration;
    return {.session = session,
            .epoch = row->epoch,
            .answers_until = asked + options_.duration - options_.margin};
  }

  ModelStore* const store_;
  const std::string holder_;
  const LeaseOptions options_;
};

}  // namespace tissueform::testing
