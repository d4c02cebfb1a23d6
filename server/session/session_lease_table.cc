// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_lease_table.h"

#include "server/session/session_errors.h"

namespace tissueform {

SessionLeaseHandle::~SessionLeaseHandle() { holds_->End(id_, state_.get()); }

absl::Status SessionLeaseHandle::Check() const {
  if (!state_->given_up && holds_->ownership_->EpochOf(id_) == epoch_) return absl::OkStatus();
  return SessionMoved("");
}

void SessionLeaseTable::Take(const std::string& id, const TakenCallback& done) {
  if (!shared()) {
    done(SessionLeaseHandlePtr());
    return;
  }
  const bool posted = Post([self = shared_from_this(), id, done] { done(self->TakeAndWait(id)); });
  if (!posted) done(absl::UnavailableError("the server is ending"));
}

absl::StatusOr<SessionLeaseHandlePtr> SessionLeaseTable::TakeAndWait(const std::string& id) {
  if (!shared()) return SessionLeaseHandlePtr();
  if (stops_taking_) return SessionMoved("");
  std::shared_ptr<State> state;
  {
    MutexLock lock(mutex_);
    std::shared_ptr<State>& known = states_[id];
    if (known == nullptr) known = std::make_shared<State>();
    state = known;
    ++state->holds;  // from now on it is not given back
    while (state->releasing) released_.Wait(mutex_);
  }
  const absl::StatusOr<int64_t> epoch = ownership_->Acquire(id);
  if (!epoch.ok()) {
    End(id, state.get());
    return epoch.status();
  }
  {
    MutexLock lock(mutex_);
    state->is_taken = true;
  }
  auto hold = std::make_shared<const SessionLeaseHandle>(shared_from_this(), state, id, *epoch);
  // A hand-over of all sessions may not have seen it.
  if (stops_taking_) state->given_up = true;
  return hold;
}

SessionLeaseHandlePtr SessionLeaseTable::NotHeld(const std::string& id, int64_t epoch) {
  auto state = std::make_shared<State>();
  state->given_up = true;
  state->holds = 1;
  return std::make_shared<const SessionLeaseHandle>(shared_from_this(), std::move(state), id,
                                                    epoch);
}

bool SessionLeaseTable::Holds(const std::string& id) const {
  if (!shared()) return true;
  {
    MutexLock lock(mutex_);
    const auto found = states_.find(id);
    if (found != states_.end() && found->second->given_up) return false;
  }
  return ownership_->EpochOf(id).has_value();
}

void SessionLeaseTable::End(const std::string& id, State* state) {
  {
    MutexLock lock(mutex_);
    if (--state->holds > 0 || state->releasing) return;
    if (!state->is_taken) {
      EraseIfIdle(id);
      return;
    }
  }
  Post([self = shared_from_this(), id] { self->ReleaseUnlessUsed(id); });
}

void SessionLeaseTable::ReleaseUnlessUsed(const std::string& id) {
  std::shared_ptr<State> state;
  {
    MutexLock lock(mutex_);
    const auto found = states_.find(id);
    if (found == states_.end()) return;
    state = found->second;
    while (state->releasing) released_.Wait(mutex_);
    if (state->holds > 0 || !state->is_taken) return;
    state->releasing = true;
  }
  ownership_->Release(id);
  MutexLock lock(mutex_);
  state->releasing = false;
  state->is_taken = false;
  EraseIfIdle(id);
  released_.NotifyAll();
}

void SessionLeaseTable::EraseIfIdle(const std::string& id) {
  const auto found = states_.find(id);
  if (found == states_.end()) return;
  const State& state = *found->second;
  if (state.holds == 0 && !state.is_taken && !state.releasing) states_.erase(found);
}

void SessionLeaseTable::GiveBack(SessionLeaseHandlePtr hold, const std::function<void()>& then) {
  if (hold == nullptr) {
    then();
    return;
  }
  const std::string id = hold->id();
  hold.reset();
  const bool posted = Post([self = shared_from_this(), id, then] {
    self->ReleaseUnlessUsed(id);
    then();
  });
  if (!posted) then();
}

std::vector<std::string> SessionLeaseTable::Held() const {
  std::vector<std::string> held;
  MutexLock lock(mutex_);
  for (const auto& [id, state] : states_) {
    if (state->is_taken) held.push_back(id);
  }
  return held;
}

void SessionLeaseTable::GiveUp(const std::string& id) {
  MutexLock lock(mutex_);
  if (const auto found = states_.find(id); found != states_.end()) found->second->given_up = true;
}

bool SessionLeaseTable::Post(WorkerPool::Job job) {
  // Under the lock: after Stop the pool may be gone.
  MutexLock lock(mutex_);
  if (!stopped_) pool_->Post(Lane::kLeases, std::move(job));
  return !stopped_;
}

void SessionLeaseTable::Stop() {
  MutexLock lock(mutex_);
  stopped_ = true;
}

}  // namespace tissueform
