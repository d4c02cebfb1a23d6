// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_loader.h"

#include <algorithm>
#include <iterator>

#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"
#include "server/session/session_errors.h"
#include "server/store/store_errors.h"

namespace tissueform {

SessionLoader::SessionLoader(MemoryBudget* budget, WorkerPool* pool, SessionStore* store,
                             MeshCatalog* catalog, SessionLeaseTable* leases, SessionTable* table,
                             StoreSync* sync, const Clock* clock)
    : budget_(budget),
      pool_(pool),
      store_(store),
      catalog_(catalog),
      leases_(leases),
      table_(table),
      sync_(sync),
      clock_(clock),
      preparations_(budget, pool) {}

bool SessionLoader::Flight::wanted() const {
  return std::any_of(waiters.begin(), waiters.end(),
                     [](const Waiter& waiter) { return !waiter.cancelled->load(); });
}

SessionLoader::Waiter SessionLoader::MakeWaiter(CancelFlag cancelled, const SessionCallback& done,
                                                const SessionProgressCallback& on_progress) {
  if (!naming_room_) return {std::move(cancelled), done, on_progress};
  return {std::move(cancelled),
          [this, done](absl::StatusOr<std::shared_ptr<Session>> made) {
            done(made.ok() ? std::move(made) : naming_room_(made.status()));
          },
          on_progress};
}

void SessionLoader::Create(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                           CancelFlag cancelled, const SessionCallback& done,
                           const SessionProgressCallback& on_progress) {
  const Waiter waiter = MakeWaiter(std::move(cancelled), done, on_progress);
  if (record.id.empty()) {
    record.id = RandomId();
    CreateKnown(std::move(record), mesh, waiter);
    return;
  }
  // The same request may have been made of another server, before anything is prepared for it.
  const std::string id = record.id;
  sync_->WhenKnown(
      id, StoreSync::Patience::kFull,
      [this, record = std::move(record), mesh, waiter, done](const absl::Status& known) {
        if (known.ok()) {
          CreateKnown(record, mesh, waiter);
        } else {
          done(known);
        }
      });
}

void SessionLoader::CreateKnown(SessionRecord record, const std::shared_ptr<const StoredMesh>& mesh,
                                const Waiter& waiter) {
  MakeRoom();
  Arrival arrival;
  {
    MutexLock lock(mutex_);
    arrival = ArriveToCreate(std::move(record), mesh, waiter);
  }
  GoOn(arrival, waiter);
}

void SessionLoader::Open(const std::string& id, CancelFlag cancelled, const SessionCallback& done,
                         const SessionProgressCallback& on_progress) {
  if (absl::StatusOr<std::shared_ptr<Session>> session = table_->Find(id); session.ok()) {
    done(std::move(session));
    return;
  }
  sync_->WhenKnown(id, StoreSync::Patience::kBrief,
                   [this, id, waiter = MakeWaiter(std::move(cancelled), done, on_progress),
                    done](const absl::Status& known) {
                     if (!known.ok()) {
                       done(known);
                       return;
                     }
                     MakeRoom();
                     Arrival arrival;
                     {
                       MutexLock lock(mutex_);
                       arrival = ArriveToOpen(id, waiter);
                     }
                     GoOn(arrival, waiter);
                   });
}

void SessionLoader::MakeRoom() {
  if (!table_->MakeRoom() && !catalog_->keeps_meshes()) sync_->RemoveIdle();
}

SessionLoader::Arrival SessionLoader::ArriveToCreate(SessionRecord record,
                                                     const std::shared_ptr<const StoredMesh>& mesh,
                                                     const Waiter& waiter) {
  if (const RequestKey key = RequestKeyOf(record); !key.request_id.empty()) {
    if (std::optional<Arrival> joined = JoinEarlierRequest(key, waiter)) return *joined;
  }
  Arrival arrival = {.found = {.refusal = table_->BeginCreation(record)}};
  if (!arrival.found.refusal.ok()) return arrival;
  const std::string id = record.id;
  arrival.started = std::make_shared<Flight>(Flight{id, std::move(record), mesh, {waiter}});
  flights_.emplace(id, arrival.started);
  return arrival;
}

SessionLoader::Arrival SessionLoader::ArriveToOpen(const std::string& id, const Waiter& waiter) {
  Arrival arrival = {.found = table_->BeginLoading(id, waiter.claims)};
  if (!arrival.found.refusal.ok() || arrival.found.session != nullptr) return arrival;
  if (const auto flight = flights_.find(id); flight != flights_.end()) {
    Arrival joined = Join(flight->second, waiter);
    joined.found = std::move(arrival.found);
    return joined;
  }
  arrival.started = std::make_shared<Flight>(Flight{id, {}, nullptr, {waiter}});
  flights_.emplace(id, arrival.started);
  return arrival;
}

std::optional<SessionLoader::Arrival> SessionLoader::JoinEarlierRequest(const RequestKey& key,
                                                                        const Waiter& waiter) {
  const auto earlier = table_->FindRequest(key.request_id);
  if (!earlier.has_value()) return std::nullopt;
  if (earlier->key.fingerprint != key.fingerprint) {
    const std::string request_id = key.request_id.substr(key.request_id.find('\n') + 1);
    return Arrival{.found = {.refusal = OtherRequest(request_id)}};
  }
  const auto flight = flights_.find(earlier->session_id);
  // Also if all its callers have canceled: FinishCreation starts it again if it stops for that.
  if (flight != flights_.end() && flight->second->creates()) return Join(flight->second, waiter);
  Waiter claimant = waiter;
  claimant.claims = true;
  Arrival arrival = ArriveToOpen(earlier->session_id, claimant);
  if (HasReason(arrival.found.refusal, ErrorReason::kSessionNotFound)) return std::nullopt;
  return arrival;
}

SessionLoader::Arrival SessionLoader::Join(const FlightPtr& flight, const Waiter& waiter) {
  flight->waiters.push_back(waiter);
  return {.joined = flight->newest};
}

void SessionLoader::GoOn(const Arrival& arrival, const Waiter& waiter) {
  table_->CloseLost(arrival.found.lost);
  if (!arrival.found.refusal.ok()) {
    waiter.done(arrival.found.refusal);
  } else if (arrival.found.session != nullptr) {
    waiter.done(arrival.found.session);
  } else if (arrival.started == nullptr) {
    if (arrival.joined.has_value() && waiter.on_progress) waiter.on_progress(*arrival.joined);
  } else if (arrival.started->creates()) {
    StartCreation(arrival.started);
  } else {
    StartLoading(arrival.started);
  }
}

void SessionLoader::StartCreation(const FlightPtr& flight) {
  Make(flight->record, flight->mesh, CallerOf(flight),
       [this, flight](absl::StatusOr<SessionView> made) {
         if (!made.ok()) {
           FinishCreation(flight, made.status());
           return;
         }
         CallerOf(flight).Report(SessionStage::kKeeping);
         Keep(*std::move(made),
              [this, flight](const absl::StatusOr<std::shared_ptr<Session>>& kept) {
                FinishCreation(flight, kept);
              });
       });
}

void SessionLoader::StartLoading(const FlightPtr& flight) {
  const auto as_it_is = [](SessionRecord record, const StoredMesh&) { return record; };
  Remake(flight->id, as_it_is, CallerOf(flight), [this, flight](absl::StatusOr<SessionView> made) {
    if (made.ok()) {
      FinishLoading(flight, std::move(made->session));
    } else {
      FinishLoading(flight, made.status());
    }
  });
}

SessionLoader::Caller SessionLoader::CallerOf(const FlightPtr& flight) {
  return {.cancellation = Cancellation([this, flight] {
            MutexLock lock(mutex_);
            return !flight->wanted();
          }),
          .on_progress = [this, flight](const SessionProgress& progress) {
            std::vector<SessionProgressCallback> listening;
            {
              MutexLock lock(mutex_);
              flight->newest = progress;
              for (const Waiter& waiter : flight->waiters) {
                if (waiter.on_progress) listening.push_back(waiter.on_progress);
              }
            }
            for (const SessionProgressCallback& on_progress : listening) on_progress(progress);
          }};
}

std::vector<SessionLoader::Waiter> SessionLoader::EndFlight(const FlightPtr& flight) {
  flights_.erase(flight->id);
  return std::exchange(flight->waiters, {});
}

// The flight ends and the session comes into the table under one lock: a repeated request joins the
// flight, or finds the session.
void SessionLoader::FinishCreation(const FlightPtr& flight,
                                   const absl::StatusOr<std::shared_ptr<Session>>& made) {
  std::vector<Waiter> waiters;
  bool again = false;
  {
    MutexLock lock(mutex_);
    // All callers had canceled, and then another one joined.
    again = absl::IsCancelled(made.status()) && flight->wanted();
    if (!again) {
      waiters = EndFlight(flight);
      table_->FinishCreation(flight->id, made.value_or(nullptr), static_cast<int>(waiters.size()));
    }
  }
  if (again) {
    StartCreation(flight);
    return;
  }
  if (made.ok() && waiters.empty()) sync_->EndUnwanted(*made);  // all have canceled
  for (const Waiter& waiter : waiters) waiter.done(made);
}

void SessionLoader::FinishLoading(const FlightPtr& flight,
                                  absl::StatusOr<std::shared_ptr<Session>> made) {
  std::vector<Waiter> waiters;
  SessionTable::Found found;
  {
    MutexLock lock(mutex_);
    // Only of callers that are answered: one that canceled has no claim.
    const auto claims = std::count_if(flight->waiters.begin(), flight->waiters.end(),
                                      [](const Waiter& waiter) { return waiter.claims; });
    found = table_->FinishLoading(flight->id, made, flight->wanted(), static_cast<int>(claims));
    if (!found.loads_again) waiters = EndFlight(flight);
  }
  table_->CloseLost(found.lost);
  if (made.ok() && *made != found.session) {
    (*made)->Close((*made)->CheckHeld().ok() ? Session::CloseReason::kDeleted
                                             : Session::CloseReason::kMoved);
    *made = nullptr;  // its memory is free before a caller is answered
  }
  if (found.loads_again) {
    StartLoading(flight);
    return;
  }
  if (HasReason(found.refusal, ErrorReason::kSessionNotFound)) sync_->OnDeleted(flight->id);
  if (found.refusal.ok()) table_->Notify(flight->id, SessionEvent::kRestored);
  for (const Waiter& waiter : waiters) {
    if (found.refusal.ok()) {
      waiter.done(found.session);
    } else {
      waiter.done(found.refusal);
    }
  }
}

void SessionLoader::Lost(const std::string& id) {
  std::vector<Waiter> waiters;
  {
    MutexLock lock(mutex_);
    const auto flight = flights_.find(id);
    if (flight != flights_.end() && !flight->second->creates()) {
      waiters = std::exchange(flight->second->waiters, {});
    }
  }
  for (const Waiter& waiter : waiters) waiter.done(SessionMoved(""));
}

void SessionLoader::CancelWait(const CancelFlag& cancelled) {
  std::vector<Waiter> gone;
  {
    MutexLock lock(mutex_);
    for (const auto& [id, flight] : flights_) {
      std::vector<Waiter>& waiters = flight->waiters;
      const auto first = std::stable_partition(
          waiters.begin(), waiters.end(),
          [&cancelled](const Waiter& waiter) { return waiter.cancelled != cancelled; });
      std::move(first, waiters.end(), std::back_inserter(gone));
      waiters.erase(first, waiters.end());
    }
  }
  for (const Waiter& waiter : gone) {
    waiter.done(absl::CancelledError("the client canceled the call"));
  }
}

void SessionLoader::Make(SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
                         Caller caller, ViewCallback done) {
  std::shared_ptr<SharedPreparation> preparation = preparations_.Find(record);
  Strand& strand = preparation->strand();
  caller.Report(SessionStage::kWaiting);
  // From now on: what this one needs may already be under way for other callers.
  auto follower = preparation->Follow(record.model, caller.on_progress);
  strand.Post(Lane::kBatch, [this, record = std::move(record), mesh = std::move(mesh),
                             preparation = std::move(preparation), caller = std::move(caller),
                             follower = std::move(follower), done = std::move(done)]() mutable {
    caller.Report(SessionStage::kAssembling);
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
    done(SessionView{std::move(record), *std::move(session)});
  });
}

void SessionLoader::Keep(SessionView made, const SessionCallback& done) {
  store_->Create(std::move(made.record), leases_->shared() ? kFreshEpoch : kSoleEpoch,
                 [this, session = std::move(made.session),
                  done](const absl::StatusOr<SessionRecord>& stored) mutable {
                   if (!stored.ok()) {
                     session.reset();  // its memory is free before the caller hears of the failure
                     done(stored.status());
                     return;
                   }
                   const std::string id = session->id();
                   leases_->Take(id, [this, id, epoch = stored->epoch, session = std::move(session),
                                      done](absl::StatusOr<SessionLeaseHandlePtr> hold) {
                     session->SetHold(hold.ok() ? *std::move(hold) : leases_->NotHeld(id, epoch));
                     done(session);
                   });
                 });
}

void SessionLoader::Remake(const std::string& id, const Change& change, const Caller& caller,
                           const ViewCallback& done) {
  caller.Report(SessionStage::kReadingMesh);
  // Before the record is read: no other server writes it from then on.
  leases_->Take(id, [this, id, change, caller, done](absl::StatusOr<SessionLeaseHandlePtr> hold) {
    if (!hold.ok()) {
      done(hold.status());
      return;
    }
    const ViewCallback held = WithHold(*std::move(hold), done);
    store_->Get(id, [this, change, caller, held](absl::StatusOr<SessionRecord> record) {
      if (!record.ok()) {
        held(record.status());
        return;
      }
      // Reading a mesh takes its time.
      const bool posted = PostUnlessStopped([this, record = *std::move(record), change, caller,
                                             held] { MakeChanged(record, change, caller, held); });
      if (!posted) held(absl::UnavailableError("the server is ending"));
    });
  });
}

SessionLoader::ViewCallback SessionLoader::WithHold(SessionLeaseHandlePtr hold,
                                                    const ViewCallback& done) {
  if (hold == nullptr) return done;
  // All copies of the callback have one.
  auto slot = std::make_shared<SessionLeaseHandlePtr>(std::move(hold));
  return [this, slot = std::move(slot), done](absl::StatusOr<SessionView> made) {
    if (made.ok()) {
      made->session->SetHold(std::exchange(*slot, nullptr));
      done(std::move(made));
    } else {
      // A client that is sent to another server finds the session free.
      leases_->GiveBack(std::exchange(*slot, nullptr),
                        [done, status = made.status()] { done(status); });
    }
  };
}

void SessionLoader::MakeChanged(const SessionRecord& record, const Change& change, Caller caller,
                                ViewCallback done) {
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

void SessionLoader::Update(const std::string& id, const std::string& etag, const Change& change,
                           CancelFlag cancelled, const ViewCallback& done,
                           SessionProgressCallback on_progress) {
  const Caller caller{.cancellation = Cancellation(
                          [cancelled = std::move(cancelled)] { return cancelled->load(); }),
                      .on_progress = std::move(on_progress)};
  // Before anything is prepared for a change that cannot be kept.
  const Change checked = [etag, change](SessionRecord record,
                                        const StoredMesh& mesh) -> absl::StatusOr<SessionRecord> {
    TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, etag, record.epoch, record.etag, record.epoch));
    return change(std::move(record), mesh);
  };
  const ViewCallback answer = [id, done](absl::StatusOr<SessionView> updated) {
    if (HasReason(updated.status(), ErrorReason::kSessionNotFound)) updated = NoSuchSession(id);
    done(std::move(updated));
  };
  sync_->WhenKnown(
      id, StoreSync::Patience::kFull, [this, id, checked, caller, answer](absl::Status refusal) {
        if (refusal.ok()) MakeRoom();
        if (refusal.ok()) refusal = table_->CheckUpdate(id);
        if (!refusal.ok()) {
          answer(refusal);
          return;
        }
        Remake(id, checked, caller, [this, caller, answer](absl::StatusOr<SessionView> remade) {
          KeepUpdate(std::move(remade), caller, answer);
        });
      });
}

void SessionLoader::KeepUpdate(absl::StatusOr<SessionView> remade, const Caller& caller,
                               const ViewCallback& done) {
  absl::Status refusal = remade.status();
  // The last moment.
  if (refusal.ok()) refusal = caller.cancellation.Check();
  if (refusal.ok()) refusal = remade->session->CheckHeld();
  if (!refusal.ok()) {
    if (remade.ok()) remade->session.reset();
    done(refusal);
    return;
  }
  caller.Report(SessionStage::kKeeping);
  sync_->KeepUpdate(*std::move(remade), done);
}

bool SessionLoader::PostUnlessStopped(WorkerPool::Job job) {
  // Under the lock: after Stop the pool may be gone.
  MutexLock lock(mutex_);
  if (!stopped_) pool_->Post(Lane::kStore, std::move(job));
  return !stopped_;
}

void SessionLoader::Stop() {
  MutexLock lock(mutex_);
  stopped_ = true;
}

}  // namespace tissueform
