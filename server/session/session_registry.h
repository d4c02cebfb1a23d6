// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_lease_table.h"
#include "server/session/session_loader.h"
#include "server/session/session_table.h"
#include "server/session/store_sync.h"
#include "server/session/worker_pool.h"
#include "server/store/session_store.h"

namespace tissueform {

// The sessions of the server by their id: each has its record in a store, and those that are used
// are in memory. One that was not used for a while leaves memory when room is needed (it is
// evicted) and is loaded again from its record when it is opened.
//
// Joins the four parts, each with its own lock: the loader uses the store sync, both use the table,
// and all use the leases. None uses one above it. Callers use the parts directly. Thread-safe.
class SessionRegistry {
 public:
  // All pointers must outlive the registry and all its sessions. `ownership` says which sessions of
  // a shared store this server may answer and write; null: the store is its own.
  SessionRegistry(const ServiceLimits& limits, MemoryBudget* budget, WorkerPool* pool,
                  SessionStore* store, MeshCatalog* catalog, const Clock* clock = Clock::System(),
                  SessionOwnership* ownership = nullptr)
      : pool_(pool),
        leases_(std::make_shared<SessionLeaseTable>(ownership, pool)),
        table_(limits, catalog, leases_.get(), clock),
        sync_(limits, &table_, store, leases_.get(), clock),
        loader_(budget, pool, store, catalog, leases_.get(), &table_, &sync_, clock) {}
  ~SessionRegistry() { Stop(); }
  SessionRegistry(const SessionRegistry&) = delete;
  SessionRegistry& operator=(const SessionRegistry&) = delete;

  SessionLoader& loader() { return loader_; }
  StoreSync& sync() { return sync_; }
  SessionTable& table() { return table_; }
  const SessionTable& table() const { return table_; }
  WorkerPool& pool() { return *pool_; }

  // This server no longer holds the session: it leaves memory, and its streams and watches
  // end (SessionEvent::kMoved), as do calls that wait for it to be loaded. Nothing where it has
  // been taken again since.
  void Lost(const std::string& id);

  // The end of a server whose store is shared: takes no session any more, and gives those that it
  // holds to others, one after the other: its streams and watches end, commits under way are waited
  // for, its lease is given back. Blocks, until `deadline` and a call to the store; leases that are
  // left run out.
  void HandOver(std::chrono::steady_clock::time_point deadline);

  // From now on nothing is posted to the pool. Call it before the pool ends.
  void Stop() {
    leases_->Stop();
    loader_.Stop();
  }

 private:
  WorkerPool* const pool_;

  // Self-synchronised; each uses those before it.
  const std::shared_ptr<SessionLeaseTable> leases_;
  SessionTable table_;
  StoreSync sync_;
  SessionLoader loader_;
};

}  // namespace tissueform
