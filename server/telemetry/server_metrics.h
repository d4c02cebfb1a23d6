// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <string>

#include "server/platform/metrics_page.h"
#include "server/session/frame_scheduler.h"
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
  std::atomic<int64_t> counts_[4] = {};
};

// The page reports what these keep; all must outlive it.
void AddFrameMetrics(const FrameMeasures& measures, MetricsPage* page);
void AddLaneMetrics(const WorkerPool& pool, MetricsPage* page);
void AddSessionMetrics(const SessionRegistry& registry, const SessionEventCounts& events,
                       MetricsPage* page);
void AddMemoryMetrics(const MemoryBudget& budget, const MeshCatalog& catalog, MetricsPage* page);
// Of a store on a disk or in a database; of one in memory there is nothing to report.
void AddStoreMetrics(const Stores& stores, MetricsPage* page);

// What TLS and logins report about themselves; a reading that is null is left out.
struct SecurityReadings {
  bool insecure = false;                            // started with --insecure
  MetricsPage::Read certificate_expires = nullptr;  // the server's own, in Unix time
  // 1 while what stands in the files, or came from the provider, is no good, and what was before
  // stays.
  MetricsPage::Read certificate_alarm = nullptr;
  MetricsPage::Read token_keys_alarm = nullptr;
  MetricsPage::Read token_keys_read = nullptr;  // when the provider's were last good, in Unix time
  MetricsPage::Read revocations_alarm = nullptr;
  MetricsPage::Read alarms = nullptr;                            // of the last two, since the start
  std::map<std::string, MetricsPage::Read> token_failures = {};  // by reason
};
void AddSecurityMetrics(const SecurityReadings& readings, MetricsPage* page);

}  // namespace tissueform
