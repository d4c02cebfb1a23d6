// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_factory.h"

#include <utility>

namespace tissueform {

SessionFactory::SessionFactory(MemoryBudget* budget, WorkerPool* pool, SessionStore* store,
                               MeshCatalog* catalog, SessionLeaseTable* holds, const Clock* clock)
    : budget_(budget),
      pool_(pool),
      store_(store),
      catalog_(catalog),
      holds_(holds),
      clock_(clock),
      preparations_(budget, pool) {}

void SessionFactory::Make(SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
                          SessionCaller caller, MadeCallback done) {
  std::shared_ptr<SharedPreparation> preparation = preparations_.Find(record);
  Strand& strand = preparation->strand();
  caller.Tell(SessionStage::kWaiting);
  // From now on: others may be making what this one needs, too.
  auto follower = preparation->Follow(record.model, caller.tell);
  strand.Post(Lane::kBatch, [this, record = std::move(record), mesh = std::move(mesh),
                             preparation = std::move(preparation), caller = std::move(caller),
                             follower = std::move(follower), done = std::move(done)]() mutable {
    caller.Tell(SessionStage::kAssembling);
    absl::StatusOr<std::shared_ptr<Session>> session =
        Session::Create(record, std::move(mesh), preparation, budget_->AccountOf(record.owner),
                        pool_, clock_, caller.cancellation);
    follower.reset();
    if (!session.ok()) {
      preparation.reset();
      done(session.status());
      return;
    }
    record.node_order = preparation->node_order();
    preparation.reset();  // else it would outlive what `done` does with the session
    done(Made{std::move(record), *std::move(session)});
  });
}

void SessionFactory::Create(SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
                            SessionCaller caller, Callback done) {
  auto keep = [this, tell = caller.tell,
               done = std::move(done)](absl::StatusOr<Made> made) mutable {
    if (!made.ok()) {
      done(made.status());
      return;
    }
    if (tell) tell({SessionStage::kKeeping});
    store_->Create(std::move(made->record), holds_->shared() ? kFreshEpoch : kSoleEpoch,
                   [this, session = std::move(made->session),
                    done = std::move(done)](const absl::StatusOr<SessionRecord>& stored) mutable {
                     if (stored.ok()) {
                       TakeNew(std::move(session), stored->epoch, done);
                     } else {
                       // Its memory is free before anybody hears of the failure and tries again.
                       session.reset();
                       done(stored.status());
                     }
                   });
  };
  Make(std::move(record), std::move(mesh), std::move(caller), std::move(keep));
}

void SessionFactory::TakeNew(std::shared_ptr<Session> session, int64_t epoch,
                             const Callback& done) {
  const std::string id = session->id();
  holds_->Take(id, [this, id, epoch, session = std::move(session),
                    done](absl::StatusOr<SessionLeaseHandlePtr> hold) {
    session->SetHold(hold.ok() ? *std::move(hold) : holds_->NotHeld(id, epoch));
    done(session);
  });
}

void SessionFactory::Restore(const std::string& id, SessionCaller caller, Callback done) {
  const auto as_it_is = [](SessionRecord record, const StoredMesh&) { return record; };
  Remake(id, as_it_is, std::move(caller), [done = std::move(done)](absl::StatusOr<Made> made) {
    if (made.ok()) {
      done(std::move(made->session));
    } else {
      done(made.status());
    }
  });
}

void SessionFactory::Remake(const std::string& id, Change change, SessionCaller caller,
                            MadeCallback done) {
  caller.Tell(SessionStage::kReadingMesh);
  // Before the record is read: nobody else writes it from then on.
  holds_->Take(id, [this, id, change = std::move(change), caller = std::move(caller),
                    done = std::move(done)](absl::StatusOr<SessionLeaseHandlePtr> hold) {
    if (hold.ok()) {
      Read(id, change, caller, WithHold(*std::move(hold), done));
    } else {
      done(hold.status());
    }
  });
}

SessionFactory::MadeCallback SessionFactory::WithHold(SessionLeaseHandlePtr hold,
                                                      MadeCallback done) {
  if (hold == nullptr) return done;
  // All copies of the callback have one.
  auto slot = std::make_shared<SessionLeaseHandlePtr>(std::move(hold));
  return [this, slot = std::move(slot), done = std::move(done)](absl::StatusOr<Made> made) {
    if (made.ok()) {
      made->session->SetHold(std::exchange(*slot, nullptr));
      done(std::move(made));
    } else {
      // A client that is told of another server finds the session free.
      holds_->GiveBack(std::exchange(*slot, nullptr),
                       [done, status = made.status()] { done(status); });
    }
  };
}

void SessionFactory::Read(const std::string& id, Change change, SessionCaller caller,
                          MadeCallback done) {
  store_->Get(id, [this, change = std::move(change), caller = std::move(caller),
                   done = std::move(done)](absl::StatusOr<SessionRecord> record) mutable {
    if (!record.ok()) {
      done(record.status());
      return;
    }
    // Reading a mesh takes its time.
    const bool posted = PostUnlessStopped(
        [this, record = *std::move(record), change = std::move(change), caller = std::move(caller),
         done]() mutable { MakeChanged(record, change, std::move(caller), std::move(done)); });
    if (!posted) done(absl::UnavailableError("the server is ending"));
  });
}

void SessionFactory::MakeChanged(const SessionRecord& record, const Change& change,
                                 SessionCaller caller, MadeCallback done) {
  absl::StatusOr<std::shared_ptr<const StoredMesh>> mesh = catalog_->Load(record.mesh_sha256);
  absl::StatusOr<SessionRecord> changed = mesh.ok() ? change(record, **mesh) : mesh.status();
  if (!changed.ok()) {
    done(changed.status());
    return;
  }
  // An order of other free vertices would do, but a worse one than may be found.
  if (changed->fixed != record.fixed || changed->handles != record.handles) {
    changed->node_order.clear();
  }
  Make(*std::move(changed), *std::move(mesh), std::move(caller), std::move(done));
}

bool SessionFactory::PostUnlessStopped(WorkerPool::Job job) {
  MutexLock lock(mutex_);
  if (!stopped_) pool_->Post(Lane::kStore, std::move(job));
  return !stopped_;
}

void SessionFactory::Stop() {
  MutexLock lock(mutex_);
  stopped_ = true;
}

}  // namespace tissueform
