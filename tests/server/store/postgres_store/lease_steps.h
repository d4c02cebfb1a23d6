// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/postgres_store/lease_keeper.h"
#include "server/store/postgres_store/session_leases.h"
#include "tests/server/store/postgres_store/model_leases.h"

// Two servers that want one session, and everything that they may do with it, in any order.
namespace tissueform::testing {

enum class LeaseAction {
  kAcquire,
  kRenew,
  // Time passes between when these are asked for and when the store does them,
  kAcquireLate,
  kRenewLate,
  // or between that and when the answer comes.
  kAcquireSlowly,
  kRenewSlowly,
  kRelease,
  kCommit,     // as a server does that may answer
  kCommitOld,  // as one that was stopped goes on with, under the epoch that it had last
  kDelete,     // as a server does that may answer
  kMakeAgain,  // under the same id, where it was deleted: by either server
  kWait,
};

struct LeaseStep {
  LeaseAction action = LeaseAction::kWait;
  int server = 0;  // 0 or 1; not used for kWait and kMakeAgain
};
using LeaseSteps = std::vector<LeaseStep>;

// Each that there is.
LeaseSteps AllLeaseSteps();
// Those in which no time passes while a call is under way.
LeaseSteps PromptLeaseSteps();
std::string ToString(const LeaseSteps& steps);

// After two of them a holder answers no more, but its lease has not run out; after three it has.
inline constexpr std::chrono::milliseconds kLeaseWait{4'750};

// A store with one session and a clock.
class LeaseWorld {
 public:
  virtual ~LeaseWorld() = default;
  virtual SessionLeases* leases(int server) = 0;
  virtual std::string session() const = 0;
  // Whether a write under this epoch was kept.
  virtual bool Commit(int64_t epoch) = 0;
  virtual bool Delete(int64_t epoch) = 0;
  // A session of the same id; its epoch. REQUIRES: it was deleted.
  virtual int64_t MakeAgain() = 0;
  virtual int64_t FirstEpoch() const = 0;  // of the one that there is at the beginning
  virtual void Wait(std::chrono::milliseconds duration) = 0;
  // So much time passes between when the next call of leases is made and when it is done.
  virtual void DelayNext(std::chrono::milliseconds duration) = 0;
  virtual std::chrono::steady_clock::time_point Now() const = 0;
};

class ModelLeaseWorld final : public LeaseWorld {
 public:
  ModelLeaseWorld() { store_.sessions["s"] = {}; }

  SessionLeases* leases(int server) override { return &leases_[static_cast<size_t>(server)]; }
  std::string session() const override { return "s"; }
  bool Commit(int64_t epoch) override { return store_.Commits("s", epoch); }
  bool Delete(int64_t epoch) override { return Commit(epoch) && store_.sessions.erase("s") == 1; }
  int64_t MakeAgain() override {
    return (store_.sessions["s"] = {.epoch = store_.NextEpoch()}).epoch;
  }
  int64_t FirstEpoch() const override { return ModelStore::Session().epoch; }
  void Wait(std::chrono::milliseconds duration) override { store_.now += duration; }
  void DelayNext(std::chrono::milliseconds duration) override { store_.next_delay = duration; }
  std::chrono::steady_clock::time_point Now() const override { return store_.now; }

  // Null where it was deleted.
  const ModelStore::Session* row() const {
    const auto found = store_.sessions.find("s");
    return found == store_.sessions.end() ? nullptr : &found->second;
  }

 private:
  ModelStore store_;
  std::array<ModelLeases, 2> leases_ = {ModelLeases(&store_, "A"), ModelLeases(&store_, "B")};
};

// Time may pass between when the store has done what it was asked for and when that is known.
class SlowLeases final : public SessionLeases {
 public:
  explicit SlowLeases(LeaseWorld* world, int server)
      : world_(*world), leases_(*world->leases(server)) {}

  absl::StatusOr<LeaseAnswer> Acquire(const std::string& session) override {
    return Answer(leases_.Acquire(session));
  }
  absl::StatusOr<std::vector<SessionLease>> Renew() override { return Answer(leases_.Renew()); }
  absl::Status Release(const std::string& session, int64_t epoch) override {
    return leases_.Release(session, epoch);
  }

  void SlowNext(std::chrono::milliseconds duration) { next_ = duration; }

 private:
  template <typename Result>
  Result Answer(Result result) {
    if (next_.count() > 0) world_.Wait(std::exchange(next_, {}));
    return result;
  }

  LeaseWorld& world_;
  SessionLeases& leases_;
  std::chrono::milliseconds next_{0};
};

// The servers with what each of them knows.
class LeaseServers {
 public:
  explicit LeaseServers(LeaseWorld* world);

  // What is seen of a step from outside: answers, and who may answer poses then.
  std::string Take(const LeaseStep& step);

  bool MayAnswer(int server) { return EpochOf(server).has_value(); }
  struct Write {
    int server = 0;
    int64_t epoch = 0;
    int64_t newest_epoch = 0;  // that had been given then
  };
  // Those that were kept, in their order.
  const std::vector<Write>& writes() const { return writes_; }
  // What the servers know, with epochs and times as they differ from now's.
  std::string Knowledge(std::chrono::steady_clock::time_point now) const;

 private:
  std::optional<int64_t> EpochOf(int server) {
    return keepers_[static_cast<size_t>(server)]->EpochOf(world_->session());
  }
  std::string TakeOne(const LeaseStep& step);
  std::string Acquire(size_t server);
  std::string Renew(size_t server);
  std::string Commit(int server, std::optional<int64_t> epoch);
  std::string Delete(int server);
  std::string MakeAgain();
  // Epochs by their order, since others are given in between: "2nd". One that does not rise is
  // called so.
  std::string Given(int64_t epoch);
  std::string NameOf(int64_t epoch) const;

  LeaseWorld* const world_;
  std::array<SlowLeases, 2> leases_;
  std::array<std::unique_ptr<LeaseKeeper>, 2> keepers_;
  std::array<int64_t, 2> last_epochs_ = {0, 0};
  // Until when each has its lease in mind; nothing when it has none.
  std::array<std::optional<std::chrono::steady_clock::time_point>, 2> until_ = {};
  std::vector<Write> writes_;
  bool exists_ = true;
  std::vector<int64_t> given_;  // epochs, in their order
};

}  // namespace tissueform::testing
