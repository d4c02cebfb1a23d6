// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/store_sync.h"

#include <algorithm>
#include <future>
#include <optional>
#include <utility>

#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/session/session_errors.h"

namespace tissueform {
namespace {

constexpr int kLearntPageSize = 1000;

absl::StatusOr<SessionStore::Page> ListAndWait(SessionStore* store,
                                               const SessionStore::ListRequest& request) {
  std::promise<absl::StatusOr<SessionStore::Page>> answer;
  store->List(request, [&answer](absl::StatusOr<SessionStore::Page> page) {
    answer.set_value(std::move(page));
  });
  return answer.get_future().get();
}

bool SameHandleNames(const std::vector<HandleRegion>& a, const std::vector<HandleRegion>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const HandleRegion& x, const HandleRegion& y) { return x.name == y.name; });
}

// Of a session whose end no caller waits for.
void WarnIfLeftBehind(const absl::Status& status) {
  if (!status.ok()) spdlog::warn("a session's record remains: {}", status.ToString());
}

}  // namespace

void StoreSync::Look(const std::string& id, const ViewCallback& done) {
  store_->Get(id, [this, id, done](absl::StatusOr<SessionRecord> record) {
    if (record.ok()) {
      std::shared_ptr<Session> session = table_->Find(id).value_or(nullptr);
      done(SessionView{*std::move(record), std::move(session)});
    } else {
      done(absl::IsNotFound(record.status()) ? NoSuchSession(id) : record.status());
    }
  });
}

void StoreSync::List(const SessionStore::ListRequest& request,
                     const std::function<void(absl::StatusOr<SessionViewPage>)>& done) {
  store_->List(request, [this, done](absl::StatusOr<SessionStore::Page> page) {
    if (!page.ok()) {
      done(page.status());
      return;
    }
    SessionViewPage views{.views = {}, .next = std::move(page->next)};
    for (SessionRecord& record : page->records) {
      std::shared_ptr<Session> session = table_->Peek(record.id);
      views.views.push_back({std::move(record), std::move(session)});
    }
    done(std::move(views));
  });
}

absl::Status StoreSync::LearnAll() {
  SessionStore::ListRequest request{.owner = std::nullopt, .after = "", .limit = kLearntPageSize};
  do {
    TF_ASSIGN_OR_RETURN(SessionStore::Page page, ListAndWait(store_, request));
    for (const SessionRecord& record : page.records) table_->Learn(record);
    request.after = std::move(page.next);
  } while (!request.after.empty());
  return absl::OkStatus();
}

void StoreSync::OnDeleted(const std::string& id) {
  if (leases_->Holds(id)) return;  // a report of the session that had this id before
  const SessionTable::Taken taken = table_->TakeGone(id);
  if (!taken.has_value()) return;
  if (taken->session != nullptr) taken->session->Close(Session::CloseReason::kDeleted);
  table_->Notify(id, SessionEvent::kDeleted);
}

void StoreSync::WhenKnown(const std::string& id, Patience patience, const StatusCallback& then) {
  if (!leases_->shared() || table_->Knows(id)) {
    then(absl::OkStatus());
    return;
  }
  auto learn = [this, then](const absl::StatusOr<SessionRecord>& record) {
    if (record.ok()) table_->Learn(*record);
    then(absl::IsNotFound(record.status()) ? absl::OkStatus() : record.status());
  };
  if (patience == Patience::kBrief) {
    store_->Peek(id, std::move(learn));
  } else {
    store_->Get(id, std::move(learn));
  }
}

// A commit is checked and counted under one lock. Updates wait until what was counted before them
// is with the store, and what comes during an update is checked after it: so no commit lies between
// the reading and the writing of an update, and none for other handles follows it. The store
// refuses an epoch that another server has made an old one after CheckHeld.
void StoreSync::CommitPoses(std::shared_ptr<const Session> session, std::vector<HandlePose> poses,
                            StatusCallback done) {
  const std::string id = session->id();
  absl::Status refusal;
  {
    MutexLock lock(mutex_);
    Writes& writes = writes_[id];
    if (writes.updates > 0) {
      writes.waiting.push_back([this, session = std::move(session), poses = std::move(poses),
                                done = std::move(done)]() mutable {
        CommitPoses(std::move(session), std::move(poses), std::move(done));
      });
      return;
    }
    refusal = session->outdated() ? SessionOutdated() : session->CheckHeld();
    if (refusal.ok()) {
      ++writes.handing_over;
      ++writes.unanswered;
    }
    EraseIfIdle(id);
  }
  if (!refusal.ok()) {
    done(std::move(refusal));
    return;
  }
  store_->CommitPoses(
      id, std::move(poses), session->epoch(),
      [this, id, done = std::move(done)](absl::Status status) {
        done(leases_->shared() ? MovedIfFenced(std::move(status)) : std::move(status));
        MutexLock lock(mutex_);
        --writes_[id].unanswered;
        fewer_.NotifyAll();
        EraseIfIdle(id);
      });
  MutexLock lock(mutex_);
  --writes_[id].handing_over;
  fewer_.NotifyAll();
  EraseIfIdle(id);
}

void StoreSync::WaitForCommits(const std::string& id,
                               std::chrono::steady_clock::time_point deadline) {
  const auto is_waiting = [this, &id]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    const auto found = writes_.find(id);
    return found != writes_.end() && found->second.unanswered > 0;
  };
  MutexLock lock(mutex_);
  while (is_waiting() && fewer_.WaitUntil(mutex_, deadline)) {
  }
}

void StoreSync::BeginUpdate(const std::string& id) {
  MutexLock lock(mutex_);
  Writes& writes = writes_[id];
  ++writes.updates;
  while (writes.handing_over > 0) fewer_.Wait(mutex_);
}

void StoreSync::EndUpdate(const std::string& id) {
  std::vector<std::function<void()>> commits;
  {
    MutexLock lock(mutex_);
    Writes& writes = writes_[id];
    if (--writes.updates == 0) std::swap(commits, writes.waiting);
    EraseIfIdle(id);
  }
  for (const std::function<void()>& commit : commits) commit();
}

void StoreSync::EraseIfIdle(const std::string& id) {
  const Writes& writes = writes_[id];
  if (writes.updates == 0 && writes.handing_over == 0 && writes.unanswered == 0) writes_.erase(id);
}

void StoreSync::KeepUpdate(SessionView updated, ViewCallback done) {
  const std::string id = updated.record.id;
  BeginUpdate(id);
  auto finish = [this, id, done = std::move(done)](absl::StatusOr<SessionView> result) {
    EndUpdate(id);
    done(std::move(result));
  };
  // Once more: poses may have been committed while it was prepared.
  store_->Get(id, [this, updated = std::move(updated), finish = std::move(finish)](
                      const absl::StatusOr<SessionRecord>& current) mutable {
    WriteUpdate(std::move(updated), current, finish);
  });
}

void StoreSync::WriteUpdate(SessionView updated, const absl::StatusOr<SessionRecord>& current,
                            const ViewCallback& done) {
  if (!current.ok()) {
    updated.session.reset();
    done(current.status());
    return;
  }
  const bool other_handles = !SameHandleNames(current->handles, updated.record.handles);
  updated.record.last_poses = other_handles ? std::vector<HandlePose>() : current->last_poses;
  const int64_t epoch = updated.session->epoch();
  store_->Update(std::move(updated.record), epoch,
                 [this, session = std::move(updated.session), other_handles,
                  done](absl::StatusOr<SessionRecord> kept) mutable {
                   absl::Status status = kept.status();
                   if (leases_->shared()) status = MovedIfFenced(std::move(status));
                   SessionView view;
                   if (status.ok()) {
                     view = {*std::move(kept), session};
                     status = table_->Replace(view, other_handles);
                   }
                   session.reset();
                   if (status.ok()) {
                     done(std::move(view));
                   } else {
                     view.session.reset();  // its memory is free before the caller hears of it
                     done(std::move(status));
                   }
                 });
}

void StoreSync::Delete(const std::string& id, const StatusCallback& done) {
  WhenKnown(id, Patience::kFull, [this, id, done](const absl::Status& known) {
    if (!known.ok()) {
      done(known);
      return;
    }
    leases_->Take(id, [this, id, done](const absl::StatusOr<SessionLeaseHandlePtr>& hold) {
      if (hold.ok()) {
        DeleteHeld(id, *hold, done);
      } else if (absl::IsNotFound(hold.status())) {
        OnDeleted(id);
        done(NoSuchSession(id));
      } else {
        done(hold.status());
      }
    });
  });
}

// A session that is being loaded is deleted like one in the store: SessionTable::FinishLoading then
// finds it gone.
void StoreSync::DeleteHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                           const StatusCallback& done) {
  const SessionTable::Taken taken = table_->Take(id);
  if (!taken.has_value()) {
    done(NoSuchSession(id));
  } else if (taken->session == nullptr) {
    EraseIfHeld(id, hold, done);
  } else {
    End(taken->session, [this, id, hold, done] { EraseIfHeld(id, hold, done); });
  }
}

void StoreSync::Abandon(const std::shared_ptr<Session>& session) {
  if (table_->TakeAbandoned(session)) EndUnwanted(session);
}

void StoreSync::EndUnwanted(const std::shared_ptr<Session>& session) {
  const SessionLeaseHandlePtr hold = session->hold();
  // Also where this server could not have its lease, or has it no longer: the database may just be
  // there again, and the client may have created and deleted it elsewhere. The store keeps the
  // record if another server has taken the session since.
  End(session, [this, id = session->id(), hold] { Erase(id, hold, WarnIfLeftBehind); });
}

void StoreSync::End(const std::shared_ptr<Session>& session, const std::function<void()>& then) {
  session->strand().Post(Lane::kSolves, [session, then] {
    session->Close(Session::CloseReason::kDeleted);
    // What is being made for it holds memory until that ends.
    if (session->making()) {
      session->making_strand().Post(Lane::kBatch, then);
    } else {
      then();
    }
  });
}

void StoreSync::EraseIfHeld(const std::string& id, const SessionLeaseHandlePtr& hold,
                            const StatusCallback& done) {
  if (const absl::Status held = CheckHold(hold); held.ok()) {
    Erase(id, hold, done);
  } else {
    OnErased(id, hold, held, done);
  }
}

void StoreSync::Erase(const std::string& id, const SessionLeaseHandlePtr& hold,
                      const StatusCallback& done) {
  store_->Delete(id, "", EpochUnder(hold), [this, id, hold, done](const absl::Status& outcome) {
    OnErased(id, hold, outcome, done);
  });
}

void StoreSync::OnErased(const std::string& id, const SessionLeaseHandlePtr& hold,
                         const absl::Status& outcome, const StatusCallback& done) {
  const absl::Status status = hold == nullptr ? outcome : MovedIfFenced(outcome);
  // Only now: a watch that is opened after it no longer finds the record. If the record of
  // a shared store is still there, the next call for the session finds it.
  const bool is_kept = hold != nullptr && !status.ok() && !absl::IsNotFound(status);
  table_->Notify(id, is_kept ? SessionEvent::kMoved : SessionEvent::kDeleted);
  // Before its id is free: the lease of this one says nothing of the next.
  if (hold != nullptr && !is_kept) leases_->Forget(id);
  table_->Ended(id);
  done(status);
}

int StoreSync::RemoveIdle() {
  const Clock::TimePoint since = clock_->Now() - limits_.session_idle_ttl;
  const int count = EndUnused(table_->Unused(since), since, SessionTable::Streams::kIgnored);
  if (count > 0) {
    spdlog::info("removed {} sessions that were idle for more than {} s", count,
                 limits_.session_idle_ttl.count());
  }
  return count;
}

int StoreSync::RemoveUnused(const std::vector<std::string>& ids, Clock::TimePoint since) {
  return EndUnused(ids, since, SessionTable::Streams::kCount);
}

int StoreSync::EndUnused(const std::vector<std::string>& ids, Clock::TimePoint since,
                         SessionTable::Streams streams) {
  int count = 0;
  for (const std::string& id : ids) {
    if (!table_->IsUnused(id, since, streams)) continue;
    const absl::StatusOr<SessionLeaseHandlePtr> hold = leases_->TakeAndWait(id);
    if (!hold.ok()) continue;  // another server may use it
    // Once more: it may have been used while the lease was taken.
    const SessionTable::Taken taken = table_->TakeUnused(id, since, streams);
    if (!taken.has_value()) continue;
    if (taken->session != nullptr) taken->session->Close(Session::CloseReason::kDeleted);
    EraseIfHeld(id, *hold, WarnIfLeftBehind);
    ++count;
  }
  return count;
}

}  // namespace tissueform
