// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>

#include "server/monitoring/metrics_page.h"
#include "server/session/frame_flow.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "server/session/worker_pool.h"
#include "server/store/stores.h"

namespace tissueform {

// What becomes of sessions beside calls. Thread-safe.
class SessionEventCounts {
 public:
  void Count(SessionEvent event) { ++counts_[static_cast<size_t>(event)]; }
  int64_t Read(SessionEvent event) const { return counts_[static_cast<size_t>(event)]; }

 private:
  std::atomic<int64_t> counts_[3] = {};
};

// The page tells what these keep; all must outlive it.
void AddFrameMetrics(const FrameMeasures& measures, MetricsPage* page);
void AddLaneMetrics(const WorkerPool& pool, MetricsPage* page);
void AddSessionMetrics(const SessionRegistry& registry, const SessionEventCounts& events,
                       MetricsPage* page);
void AddMemoryMetrics(const MemoryBudget& budget, const MeshCatalog& catalog, MetricsPage* page);
// Of a store on a disk; of one in memory there is nothing to tell.
void AddStoreMetrics(const Stores& stores, MetricsPage* page);

// What the server's locks tell of themselves; a reading that is null is left out.
struct SecurityReadings {
  bool insecure = false;  // started with --insecure
  // Unix times.
  MetricsPage::Read certificate_expires = nullptr;  // the server's own
  MetricsPage::Read client_ca_expires = nullptr;    // the first of the clients' authorities
  MetricsPage::Read token_keys_read = nullptr;      // when keys of tokens were last read and good
  MetricsPage::Read token_keys_expire = nullptr;    // when the first of them may be used no longer
  // Times that new keys were nonsense and the old ones stayed.
  MetricsPage::Read token_key_alarms = nullptr;
};
void AddSecurityMetrics(const SecurityReadings& readings, MetricsPage* page);

}  // namespace tissueform
