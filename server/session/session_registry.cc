// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_registry.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "server/auth/identity.h"

namespace tissueform {
namespace {

absl::Status NoSuchSession(const std::string& id) {
  return WithReason(absl::NotFoundError(absl::StrCat(
                        "no session \"sessions/", id,
                        "\": it was deleted, or removed after being idle; create it again")),
                    ErrorReason::kSessionNotFound);
}

absl::Status OtherRequest(const std::string& request_id) {
  return WithReason(
      absl::InvalidArgumentError(absl::StrCat("request_id \"", request_id,
                                              "\" was used for another request; choose a new one")),
      ErrorReason::kRequestIdReused);
}

absl::Status TakenId(const std::string& id) {
  return WithReason(
      absl::AlreadyExistsError(absl::StrCat("a session \"sessions/", id,
                                            "\" exists already; choose another session_id")),
      ErrorReason::kSessionIdTaken);
}

absl::Status EndingId(const std::string& id) {
  return WithReason(
      absl::UnavailableError(
          absl::StrCat("the session \"sessions/", id,
                       "\" is being deleted; try again in a moment, or choose another session_id")),
      ErrorReason::kSessionBeingDeleted);
}

// Where nobody waits for the end of a session.
void WarnIfLeftBehind(const absl::Status& status) {
  if (!status.ok()) spdlog::warn("a session's record stays behind: {}", status.ToString());
}

// This process is the only one that writes to its store; a store that outlives its server gives
// each start an epoch of its own.
constexpr int64_t kEpoch = 1;

}  // namespace

SessionRegistry::SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget,
                                 WorkerPool* pool, SessionStore* store, const Clock* clock)
    : limits_(limits),
      budget_(budget),
      pool_(pool),
      store_(store),
      clock_(clock),
      preparations_(budget, pool) {}

void SessionRegistry::Create(SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
                             CancelFlag cancelled, const CreateCallback& done) {
  if (record.id.empty()) {
    record.id = RandomId();
  }
  Admission admission = Admit(record, Waiter{std::move(cancelled), done});
  if (!admission.refusal.ok()) {
    done(std::move(admission.refusal));
    return;
  }
  if (admission.existing != nullptr) {
    done(std::move(admission.existing));
    return;
  }
  if (admission.started == nullptr) {
    return;
  }
  std::shared_ptr<SharedPreparation> preparation = preparations_.Find(record);
  Strand& strand = preparation->strand();
  strand.Post(Lane::kBatch,
              [this, creation = std::move(admission.started), record = std::move(record),
               mesh = std::move(mesh), preparation = std::move(preparation)]() mutable {
                Make(creation, std::move(record), std::move(mesh), std::move(preparation));
              });
}

void SessionRegistry::Make(const std::shared_ptr<Creation>& creation, SessionRecord record,
                           std::shared_ptr<const StoredMesh> mesh,
                           std::shared_ptr<SharedPreparation> preparation) {
  const Cancellation cancellation([this, &creation] { return AllCancelled(*creation); });
  absl::StatusOr<std::shared_ptr<Session>> session = Session::Create(
      record, std::move(mesh), std::move(preparation), budget_, pool_, clock_, cancellation);
  if (!session.ok()) {
    FinishCreation(creation, session.status());
    return;
  }
  // After the session, so that no record tells of one that could not be made.
  store_->Create(std::move(record), kEpoch,
                 [this, creation, session = *std::move(session)](
                     const absl::StatusOr<SessionRecord>& stored) mutable {
                   if (stored.ok()) {
                     FinishCreation(creation, std::move(session));
                   } else {
                     // Its memory is free before anybody hears of the failure and tries again.
                     session.reset();
                     FinishCreation(creation, stored.status());
                   }
                 });
}

SessionRegistry::Admission SessionRegistry::Admit(const SessionRecord& record,
                                                  const Waiter& waiter) {
  const RequestKey key{record.request_id, record.request_fingerprint};
  bool full = false;
  {
    MutexLock lock(mutex_);
    full = Full();
  }
  // Only now: nothing is forgotten while there is room. Not under the lock, which RemoveIdle takes
  // and leaves before sessions end; others may come meanwhile, so whether there is room is asked
  // again below.
  if (full) {
    RemoveIdle();
  }
  Admission admission;
  MutexLock lock(mutex_);
  if (!key.request_id.empty() && JoinEarlierRequest(key, waiter, &admission)) {
    return admission;
  }
  if (IsTaken(record.id)) {
    admission.refusal = TakenId(record.id);
    return admission;
  }
  if (ending_.find(record.id) != ending_.end()) {
    admission.refusal = EndingId(record.id);
    return admission;
  }
  if (Full()) {
    admission.refusal =
        WithReason(absl::ResourceExhaustedError(absl::StrCat(
                       "the server holds ", limits_.max_sessions,
                       " sessions, as many as it may; delete one or raise --max-sessions")),
                   ErrorReason::kTooManySessions, {{"limit", absl::StrCat(limits_.max_sessions)}});
    return admission;
  }
  admission.started = std::make_shared<Creation>(Creation{record.id, key, {waiter}});
  creations_.push_back(admission.started);
  return admission;
}

bool SessionRegistry::IsTaken(const std::string& id) const {
  return sessions_.find(id) != sessions_.end() ||
         std::any_of(creations_.begin(), creations_.end(),
                     [&id](const auto& creation) { return creation->id == id; });
}

bool SessionRegistry::JoinEarlierRequest(const RequestKey& key, const Waiter& waiter,
                                         Admission* admission) {
  if (const auto known = session_of_request_.find(key.request_id);
      known != session_of_request_.end()) {
    Entry& entry = sessions_.at(known->second);
    if (entry.key.fingerprint != key.fingerprint) {
      admission->refusal = OtherRequest(key.request_id);
      return true;
    }
    ++entry.claims;
    entry.session->Touch();
    admission->existing = entry.session;
    return true;
  }
  const auto creation = std::find_if(
      creations_.begin(), creations_.end(),
      [&key](const auto& candidate) { return candidate->key.request_id == key.request_id; });
  if (creation == creations_.end()) {
    return false;
  }
  if ((*creation)->key.fingerprint != key.fingerprint) {
    admission->refusal = OtherRequest(key.request_id);
  } else if ((*creation)->waiters.empty()) {
    // It is being given up, perhaps past the last moment at which somebody could join.
    admission->refusal = EndingId((*creation)->id);
  } else {
    (*creation)->waiters.push_back(waiter);
  }
  return true;
}

bool SessionRegistry::Full() const {
  return sessions_.size() + creations_.size() >= static_cast<size_t>(limits_.max_sessions);
}

bool SessionRegistry::AllCancelled(const Creation& creation) const {
  MutexLock lock(mutex_);
  return std::all_of(creation.waiters.begin(), creation.waiters.end(),
                     [](const Waiter& waiter) { return waiter.cancelled->load(); });
}

void SessionRegistry::FinishCreation(const std::shared_ptr<Creation>& creation,
                                     absl::StatusOr<std::shared_ptr<Session>> result) {
  std::vector<Waiter> waiters;
  bool nobody_waits = false;
  {
    MutexLock lock(mutex_);
    creations_.erase(std::find(creations_.begin(), creations_.end(), creation));
    waiters = std::move(creation->waiters);
    nobody_waits = waiters.empty();  // all have cancelled
    if (result.ok() && nobody_waits) {
      ending_.insert((*result)->id());
    } else if (result.ok()) {
      const std::string& id = (*result)->id();
      sessions_[id] = Entry{*result, creation->key, static_cast<int>(waiters.size())};
      if (!creation->key.request_id.empty()) {
        session_of_request_[creation->key.request_id] = id;
      }
    }
  }
  if (result.ok() && nobody_waits) {
    End(*result, WarnIfLeftBehind);
  }
  for (const Waiter& waiter : waiters) {
    waiter.done(result);
  }
}

void SessionRegistry::CancelCreate(const CancelFlag& cancelled) {
  std::vector<Waiter> gone;
  {
    MutexLock lock(mutex_);
    for (const std::shared_ptr<Creation>& creation : creations_) {
      std::vector<Waiter>& waiters = creation->waiters;
      const auto first_gone = std::partition(
          waiters.begin(), waiters.end(),
          [&cancelled](const Waiter& waiter) { return waiter.cancelled != cancelled; });
      std::move(first_gone, waiters.end(), std::back_inserter(gone));
      waiters.erase(first_gone, waiters.end());
    }
  }
  for (const Waiter& waiter : gone) {
    waiter.done(absl::CancelledError("the client has cancelled the call"));
  }
}

void SessionRegistry::Abandon(const std::shared_ptr<Session>& session) {
  {
    MutexLock lock(mutex_);
    const auto found = sessions_.find(session->id());
    // Clients choose ids: another session may have it by now.
    if (found == sessions_.end() || found->second.session != session ||
        --found->second.claims > 0) {
      return;
    }
    Take(session->id());
  }
  End(session, WarnIfLeftBehind);
}

void SessionRegistry::End(const std::shared_ptr<Session>& session,
                          const std::function<void(absl::Status)>& done) {
  session->strand().Post(Lane::kSolves, [this, session, done] {
    session->Close();
    // What is being made for it holds memory until that ends.
    const auto forget = [this, id = session->id(), done] { Forget(id, done); };
    if (session->making()) {
      session->making_strand().Post(Lane::kBatch, forget);
    } else {
      forget();
    }
  });
}

void SessionRegistry::Forget(const std::string& id, std::function<void(absl::Status)> done) {
  store_->Delete(id, "", kEpoch, [this, id, done = std::move(done)](const absl::Status& status) {
    {
      MutexLock lock(mutex_);
      ending_.erase(id);
    }
    done(status);
  });
}

absl::StatusOr<std::shared_ptr<Session>> SessionRegistry::Find(const std::string& id) {
  MutexLock lock(mutex_);
  const auto found = sessions_.find(id);
  if (found == sessions_.end()) {
    return NoSuchSession(id);
  }
  found->second.session->Touch();
  return found->second.session;
}

void SessionRegistry::Delete(const std::string& id, const std::function<void(absl::Status)>& done) {
  std::shared_ptr<Session> session;
  {
    MutexLock lock(mutex_);
    session = Take(id);
  }
  if (session == nullptr) {
    done(NoSuchSession(id));
    return;
  }
  End(session, done);
}

int SessionRegistry::RemoveIdle() {
  std::vector<std::shared_ptr<Session>> removed;
  {
    MutexLock lock(mutex_);
    const auto cutoff = clock_->Now() - limits_.session_idle_ttl;
    std::vector<std::string> idle;
    for (const auto& [id, entry] : sessions_) {
      if (entry.session->last_used() <= cutoff) {
        idle.push_back(id);
      }
    }
    for (const std::string& id : idle) {
      removed.push_back(Take(id));
    }
  }
  const int count = static_cast<int>(removed.size());
  if (count > 0) {
    spdlog::info("removed {} sessions that were idle for more than {} s", count,
                 limits_.session_idle_ttl.count());
  }
  for (std::shared_ptr<Session>& session : removed) {
    Forget(session->id(), WarnIfLeftBehind);
    // Usually the last reference, which frees the memory here and now. A silent stream may hold
    // another one: then the strand does it.
    if (session.use_count() > 1) {
      Strand& strand = session->strand();
      strand.Post(Lane::kSolves, [held = std::move(session)] { held->Close(); });
    }
    session.reset();
  }
  return count;
}

int SessionRegistry::size() const {
  MutexLock lock(mutex_);
  return static_cast<int>(sessions_.size());
}

std::shared_ptr<Session> SessionRegistry::Take(const std::string& id) {
  const auto found = sessions_.find(id);
  if (found == sessions_.end()) {
    return nullptr;
  }
  if (!found->second.key.request_id.empty()) {
    session_of_request_.erase(found->second.key.request_id);
  }
  std::shared_ptr<Session> session = std::move(found->second.session);
  sessions_.erase(found);
  ending_.insert(id);
  return session;
}

}  // namespace tissueform
