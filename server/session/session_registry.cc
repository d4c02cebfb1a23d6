// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_registry.h"

#include <utility>

#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "server/session/session_errors.h"

namespace tissueform {

SessionRegistry::SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget,
                                 WorkerPool* pool, SessionStore* store, MeshCatalog* catalog,
                                 const Clock* clock, SessionOwnership* ownership)
    : pool_(pool),
      store_(store),
      clock_(clock),
      holds_(std::make_shared<SessionLeaseTable>(ownership, pool)),
      maker_(budget, pool, store, catalog, holds_.get(), clock),
      endings_(limits, &sessions_, store, catalog, holds_.get(), clock,
               [this](const std::string& id, Event event) { observer_(id, event); }),
      makings_(limits, &sessions_, catalog, &maker_, &endings_,
               [this](const std::string& id, Event event) { observer_(id, event); }),
      commits_(store),
      updates_(&maker_, store, &commits_,
               [this](const SessionFactory::Made& remade, bool other_handles) {
                 return Replace(remade, other_handles);
               }),
      news_(&sessions_, store, clock) {}

void SessionRegistry::HandOver(std::chrono::steady_clock::time_point deadline) {
  holds_->StopTaking();
  for (const std::string& id : holds_->Held()) {
    holds_->GiveUp(id);
    Lost(id);
    commits_.WaitFor(id, deadline);
    // A commit that is still under way is refused once another server has the session.
    if (std::chrono::steady_clock::now() < deadline) holds_->Release(id);
  }
}

void SessionRegistry::Lost(const std::string& id) {
  endings_.Lost(id);
  if (!holds_->Holds(id)) makings_.Lost(id);
}

void SessionRegistry::WhenKnown(const std::string& id, Ask ask, const std::function<void()>& then,
                                const StatusCallback& refuse) {
  if (!holds_->shared() || Knows(id)) {
    then();
  } else {
    (news_.*ask)(id, [then, refuse](const absl::Status& asked) {
      if (asked.ok() || absl::IsNotFound(asked)) {
        then();  // which says so
      } else {
        refuse(asked);
      }
    });
  }
}

void SessionRegistry::Delete(const std::string& id, const StatusCallback& done) {
  WhenKnown(
      id, &StoreSync::Ask, [this, id, done] { endings_.Delete(id, done); }, done);
}

SessionRegistry::SessionCallback SessionRegistry::NamingRoom(const SessionCallback& done) const {
  if (!naming_room_) return done;
  return [this, done](absl::StatusOr<std::shared_ptr<Session>> made) {
    done(made.ok() ? std::move(made) : naming_room_(made.status()));
  };
}

void SessionRegistry::Create(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                             CancelFlag cancelled, const SessionCallback& done,
                             const TellSession& tell) {
  const SessionWaiter waiter{std::move(cancelled), NamingRoom(done), tell};
  if (record.id.empty() || !holds_->shared()) {
    if (record.id.empty()) record.id = RandomId();
    makings_.Create(record, mesh, waiter);
    return;
  }
  // The same request may have been made of another server, before anything is prepared for it.
  WhenKnown(
      record.id, &StoreSync::Ask,
      [this, record, mesh, waiter] { makings_.Create(record, mesh, waiter); }, done);
}

void SessionRegistry::Open(const std::string& id, CancelFlag cancelled, const SessionCallback& done,
                           const TellSession& tell) {
  if (std::shared_ptr<Session> session = Loaded(id); session != nullptr) {
    done(std::move(session));
    return;
  }
  const SessionWaiter waiter{std::move(cancelled), NamingRoom(done), tell};
  WhenKnown(
      id, &StoreSync::AskBriefly, [this, id, waiter] { makings_.Open(id, waiter); }, done);
}

std::shared_ptr<Session> SessionRegistry::Loaded(const std::string& id) {
  MutexLock lock(sessions_.mutex);
  const SessionEntry* known = sessions_.table.Find(id);
  if (known == nullptr || known->session == nullptr) return nullptr;
  if (!known->session->CheckHeld().ok()) return nullptr;
  known->session->Touch();
  return known->session;
}

absl::StatusOr<std::shared_ptr<Session>> SessionRegistry::Find(const std::string& id) {
  std::shared_ptr<Session> session = Loaded(id);
  if (session == nullptr) return NoSuchSession(id);
  return session;
}

void SessionRegistry::Look(const std::string& id,
                           const std::function<void(absl::StatusOr<View>)>& done) {
  store_->Get(id, [this, id, done](absl::StatusOr<SessionRecord> record) {
    if (record.ok()) {
      std::shared_ptr<Session> session = Loaded(id);
      done(View{*std::move(record), std::move(session)});
    } else {
      done(absl::IsNotFound(record.status()) ? NoSuchSession(id) : record.status());
    }
  });
}

void SessionRegistry::List(const SessionStore::ListRequest& request,
                           const std::function<void(absl::StatusOr<ViewPage>)>& done) {
  store_->List(request, [this, done](absl::StatusOr<SessionStore::Page> page) {
    if (!page.ok()) {
      done(page.status());
      return;
    }
    ViewPage views{.views = {}, .next = std::move(page->next)};
    {
      MutexLock lock(sessions_.mutex);
      for (SessionRecord& record : page->records) {
        const SessionEntry* known = sessions_.table.Find(record.id);
        views.views.push_back({std::move(record), known == nullptr ? nullptr : known->session});
      }
    }
    done(std::move(views));
  });
}

void SessionRegistry::Update(const std::string& id, const std::string& etag,
                             SessionFactory::Change change, CancelFlag cancelled,
                             const std::function<void(absl::StatusOr<View>)>& done,
                             TellSession tell) {
  const SessionCaller caller{.cancellation = Cancellation(
                                 [cancelled = std::move(cancelled)] { return cancelled->load(); }),
                             .tell = std::move(tell)};
  WhenKnown(
      id, &StoreSync::Ask,
      [this, id, etag, change = std::move(change), caller, done] {
        if (absl::Status refusal = makings_.AdmitRemaking(id); !refusal.ok()) {
          done(std::move(refusal));
        } else {
          StartUpdate(id, etag, change, caller, done);
        }
      },
      done);
}

void SessionRegistry::StartUpdate(const std::string& id, const std::string& etag,
                                  const SessionFactory::Change& change, const SessionCaller& caller,
                                  const std::function<void(absl::StatusOr<View>)>& done) {
  updates_.Update(id, etag, change, caller,
                  [id, done](absl::StatusOr<SessionFactory::Made> remade) {
                    if (remade.ok()) {
                      done(View{std::move(remade->record), std::move(remade->session)});
                    } else if (HasReason(remade.status(), ErrorReason::kSessionNotFound)) {
                      done(NoSuchSession(id));
                    } else {
                      done(remade.status());
                    }
                  });
}

absl::Status SessionRegistry::Replace(const SessionFactory::Made& remade, bool other_handles) {
  std::shared_ptr<Session> before;
  {
    MutexLock lock(sessions_.mutex);
    SessionEntry* known = sessions_.table.Find(remade.record.id);
    if (known == nullptr) return NoSuchSession(remade.record.id);  // deleted meanwhile
    before = std::exchange(known->session, remade.session);
    known->mesh.reset();
    ++known->version;
    if (before != nullptr) known->evicted.push_back(before);
    // Whoever opens it from now on gets the new one; who holds another shall know why.
    for (const std::weak_ptr<Session>& earlier : known->evicted) {
      if (const std::shared_ptr<Session> held = earlier.lock()) held->MarkUpdated(other_handles);
    }
  }
  if (before != nullptr) before->Close(Session::CloseReason::kUpdated);
  return absl::OkStatus();
}

SessionRegistry::Use SessionRegistry::UsedSince(Clock::TimePoint since) const {
  Use use;
  std::set<std::string> meshes;
  MutexLock lock(sessions_.mutex);
  use.sessions = sessions_.table.InUse(since);
  for (const std::string& id : use.sessions) meshes.insert(sessions_.table.Find(id)->mesh_sha256);
  use.meshes.assign(meshes.begin(), meshes.end());
  return use;
}

bool SessionRegistry::Knows(const std::string& id) const {
  MutexLock lock(sessions_.mutex);
  return sessions_.table.Find(id) != nullptr;
}

std::vector<std::shared_ptr<Session>> SessionRegistry::Loaded() const {
  MutexLock lock(sessions_.mutex);
  return sessions_.table.Loaded();
}

int SessionRegistry::size() const {
  MutexLock lock(sessions_.mutex);
  return static_cast<int>(sessions_.table.num_loaded_in_table());
}

int SessionRegistry::CountKnown() const {
  MutexLock lock(sessions_.mutex);
  return static_cast<int>(sessions_.table.num_known());
}

int SessionRegistry::CountMadeFrom(const std::string& mesh_sha256) const {
  MutexLock lock(sessions_.mutex);
  return sessions_.table.CountMadeFrom(mesh_sha256);
}

}  // namespace tissueform
