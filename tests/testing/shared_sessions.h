// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error_reason.h"
#include "core/base/mutex.h"
#include "server/session/session_lease_table.h"
#include "server/store/store_errors.h"
#include "tests/testing/in_memory_stores.h"

// Servers that share a store, in one process: who holds a session by leases on a clock that a test
// turns, and a store that refuses writes under old epochs.
namespace tissueform::testing {

// What all servers share. Thread-safe.
class SharedSessions {
 public:
  static constexpr int kLeaseSeconds = 10;

  struct Lease {
    std::string node = "";  // empty: no holder
    int64_t epoch = 0;
    int until = 0;
  };

  void Wait(int seconds) {
    MutexLock lock(mutex_);
    now_ += seconds;
  }
  int now() const {
    MutexLock lock(mutex_);
    return now_;
  }
  // What is kept of a session; nothing if it does not exist.
  std::optional<Lease> Find(const std::string& id) const {
    MutexLock lock(mutex_);
    const auto found = leases_.find(id);
    return found == leases_.end() ? std::nullopt : std::optional<Lease>(found->second);
  }
  // Writes that were kept though another server had taken the session over.
  int stale_writes() const {
    MutexLock lock(mutex_);
    return stale_writes_;
  }
  // That were refused for it.
  int refused_writes() const {
    MutexLock lock(mutex_);
    return refused_writes_;
  }

 private:
  friend class FakeOwnership;
  friend class SharedSessionStore;

  // Greater than every one before, of any session.
  int64_t NextEpoch() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return ++newest_epoch_; }

  mutable Mutex mutex_;
  int64_t newest_epoch_ ABSL_GUARDED_BY(mutex_) = kSoleEpoch;
  int now_ ABSL_GUARDED_BY(mutex_) = 0;
  int stale_writes_ ABSL_GUARDED_BY(mutex_) = 0;
  int refused_writes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, Lease> leases_ ABSL_GUARDED_BY(mutex_);
  InMemorySessionStore store_;
};

// One server's side of the leases. A server that is stopped goes on as if no time had passed.
class FakeOwnership final : public SessionOwnership {
 public:
  FakeOwnership(SharedSessions* shared, std::string node)
      : shared_(*shared), node_(std::move(node)) {}

  absl::StatusOr<int64_t> Acquire(const std::string& id) override {
    std::function<void()> acquired;
    bool is_silent = false;
    {
      MutexLock lock(shared_.mutex_);
      acquired = acquired_;
      is_silent = is_silent_;
    }
    const absl::StatusOr<int64_t> epoch =
        is_silent ? absl::UnavailableError("the store does not answer") : TakeLease(id);
    if (acquired) acquired();
    return epoch;
  }

  std::optional<int64_t> EpochOf(const std::string& id) override {
    std::function<void()> ended;
    {
      MutexLock lock(shared_.mutex_);
      if (answers_left_ == 0) ended = std::exchange(ended_, nullptr);
    }
    if (ended) ended();
    MutexLock lock(shared_.mutex_);
    if (answers_left_ == 0) return std::nullopt;
    if (answers_left_ > 0) --answers_left_;
    const auto found = known_.find(id);
    if (found == known_.end()) return std::nullopt;
    if (!stopped_ && found->second.until <= shared_.now_) return std::nullopt;
    return found->second.epoch;
  }

  void Forget(const std::string& id) override {
    MutexLock lock(shared_.mutex_);
    known_.erase(id);
  }

  void Release(const std::string& id) override {
    MutexLock lock(shared_.mutex_);
    const auto known = known_.find(id);
    if (known == known_.end()) return;
    ++releases_;
    const int64_t epoch = known->second.epoch;
    known_.erase(known);
    const auto found = shared_.leases_.find(id);
    if (found == shared_.leases_.end() || found->second.epoch != epoch) return;
    found->second.node = "";
    found->second.until = 0;
  }

  // Renews what has not run out, and returns what is lost.
  std::vector<std::string> Renew() {
    std::vector<std::string> lost;
    MutexLock lock(shared_.mutex_);
    for (auto& [id, known] : known_) {
      const auto found = shared_.leases_.find(id);
      const bool mine = found != shared_.leases_.end() && found->second.node == node_ &&
                        found->second.epoch == known.epoch && found->second.until > shared_.now_;
      if (mine) {
        known.until = found->second.until = shared_.now_ + SharedSessions::kLeaseSeconds;
      } else {
        lost.push_back(id);
      }
    }
    for (const std::string& id : lost) known_.erase(id);
    return lost;
  }

  // What may no longer be answered, without asking the store.
  std::vector<std::string> TakeEnded() {
    std::vector<std::string> ended;
    MutexLock lock(shared_.mutex_);
    for (const auto& [id, known] : known_) {
      if (known.until <= shared_.now_) ended.push_back(id);
    }
    for (const std::string& id : ended) known_.erase(id);
    return ended;
  }

  void set_stopped(bool stopped) {
    MutexLock lock(shared_.mutex_);
    stopped_ = stopped;
  }
  // Nothing can be acquired.
  void set_silent(bool silent) {
    MutexLock lock(shared_.mutex_);
    is_silent_ = silent;
  }
  // Called at the end of each Acquire, without a lock.
  void set_acquired(std::function<void()> acquired) {
    MutexLock lock(shared_.mutex_);
    acquired_ = std::move(acquired);
  }
  // After so many more answers of EpochOf the sessions are lost; `ended` when the next is asked
  // for.
  void set_answers_left(int answers, std::function<void()> ended) {
    MutexLock lock(shared_.mutex_);
    answers_left_ = answers;
    ended_ = std::move(ended);
  }
  int releases() const {
    MutexLock lock(shared_.mutex_);
    return releases_;
  }

 private:
  absl::StatusOr<int64_t> TakeLease(const std::string& id) {
    MutexLock lock(shared_.mutex_);
    if (const auto known = known_.find(id);
        known != known_.end() && known->second.until > shared_.now_) {
      return known->second.epoch;  // the store is not asked
    }
    const auto found = shared_.leases_.find(id);
    if (found == shared_.leases_.end()) return NoSession(id);
    SharedSessions::Lease& lease = found->second;
    const bool runs = lease.until > shared_.now_;
    if (runs && lease.node != node_) {
      return WithReason(absl::UnavailableError("another server holds the session"),
                        ErrorReason::kSessionMoved, {{"node", lease.node}});
    }
    if (!runs) lease.epoch = shared_.NextEpoch();
    lease.node = node_;
    lease.until = shared_.now_ + SharedSessions::kLeaseSeconds;
    known_[id] = lease;
    return lease.epoch;
  }

  SharedSessions& shared_;
  const std::string node_;
  // Guarded by the mutex of what is shared.
  std::map<std::string, SharedSessions::Lease> known_;
  std::function<void()> acquired_;
  std::function<void()> ended_;
  int answers_left_ = -1;  // without end
  bool stopped_ = false;
  bool is_silent_ = false;
  int releases_ = 0;
};

// One server's side of the store.
class SharedSessionStore final : public SessionStore {
 public:
  SharedSessionStore(SharedSessions* shared, std::string node)
      : shared_(*shared), node_(std::move(node)) {}

  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override {
    const std::string id = record.id;
    absl::StatusOr<SessionRecord> created;
    {
      MutexLock lock(shared_.mutex_);
      if (epoch == kFreshEpoch) epoch = shared_.NextEpoch();
      shared_.store_.Create(std::move(record), epoch, Into(&created));
      if (created.ok()) shared_.leases_[id] = {.epoch = epoch};
    }
    done(std::move(created));
  }
  void Get(const std::string& id, RecordCallback done) override {
    shared_.store_.Get(id, std::move(done));
  }
  void Peek(const std::string& id, RecordCallback done) override { Get(id, std::move(done)); }
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override {
    absl::StatusOr<SessionRecord> updated;
    const std::string id = record.id;
    const absl::Status outcome = Write(id, epoch, [&] {
      shared_.store_.Update(std::move(record), epoch, Into(&updated));
      return updated.status();
    });
    done(outcome.ok() ? std::move(updated) : outcome);
  }
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override {
    {
      MutexLock lock(shared_.mutex_);
      if (is_silent_) {
        unanswered_.push_back(std::move(done));
        asked_.NotifyAll();
        return;
      }
    }
    done(Write(id, epoch, [&] {
      absl::Status committed;
      shared_.store_.CommitPoses(id, std::move(poses), epoch, Into(&committed));
      return committed;
    }));
  }
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override {
    done(Write(
        id, epoch,
        [&] {
          absl::Status deleted;
          shared_.store_.Delete(id, etag, epoch, Into(&deleted));
          return deleted;
        },
        /*is_last=*/true));
  }
  void List(const ListRequest& request, PageCallback done) override {
    shared_.store_.List(request, std::move(done));
  }
  void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) override {
    shared_.store_.Touch(std::move(ids), now_s, std::move(done));
  }
  void ListUnused(int64_t before_s, int limit, PageCallback done) override {
    shared_.store_.ListUnused(before_s, limit, std::move(done));
  }

  // From now on commits are not answered.
  void FallSilent() {
    MutexLock lock(shared_.mutex_);
    is_silent_ = true;
  }
  // The first of those that were not, when it has come.
  StatusCallback WaitForUnanswered() {
    MutexLock lock(shared_.mutex_);
    while (unanswered_.empty()) asked_.Wait(shared_.mutex_);
    return unanswered_.front();
  }

 private:
  template <typename Result>
  static std::function<void(Result)> Into(Result* result) {
    return [result](Result answer) { *result = std::move(answer); };
  }

  // One write; no server takes the session between the look at its epoch and the write.
  absl::Status Write(const std::string& id, int64_t epoch,
                     const std::function<absl::Status()>& write, bool is_last = false) {
    MutexLock lock(shared_.mutex_);
    const auto found = shared_.leases_.find(id);
    if (found == shared_.leases_.end()) return NoSession(id);
    const SharedSessions::Lease lease = found->second;
    if (epoch < lease.epoch) {
      ++shared_.refused_writes_;
      return CheckSessionWrite(id, "", epoch, "", lease.epoch);
    }
    absl::Status written = write();
    const bool taken = !lease.node.empty() && lease.node != node_;
    if (written.ok() && (taken || lease.epoch != epoch)) ++shared_.stale_writes_;
    if (written.ok() && is_last) shared_.leases_.erase(found);
    return written;
  }

  SharedSessions& shared_;
  const std::string node_;
  // Guarded by the mutex of what is shared.
  bool is_silent_ = false;
  std::vector<StatusCallback> unanswered_;
  ConditionVariable asked_;
};

}  // namespace tissueform::testing
