// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/cluster/change_follower.h"
#include "server/cluster/cluster_node.h"
#include "server/cluster/cluster_options.h"
#include "server/cluster/export_lookups.h"
#include "server/platform/metrics_page.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/postgres_store/postgres_stores.h"

namespace tissueform {

// All that makes a server one of several, joined: what it holds, what it hears, what it looks for.
//
// Opened, then joined with the rooms, then started when these have learnt what the store has;
// stopped before any of them ends. One thread, but for node().
class Cluster {
 public:
  // What changes in the store from here on is not missed. `stores` must outlive Stop. Errors:
  // InvalidArgument (the name), those of PostgresPool::Open and ChangeFollower::Start.
  static absl::StatusOr<std::unique_ptr<Cluster>> Open(const ClusterOptions& options, int port,
                                                       PostgresStores* stores);
  ~Cluster() { Stop(); }
  Cluster(const Cluster&) = delete;
  Cluster& operator=(const Cluster&) = delete;

  ClusterNode& node() { return node_; }
  const std::string& name() const { return node_.name(); }
  const ExportLookups& lookups() const { return lookups_; }

  // From now on the listeners look up what they do not know. All must outlive Stop.
  void Join(ClusterListeners rooms);
  // `free_bytes` says how much memory sessions may still take here; any thread.
  void Start(std::function<int64_t()> free_bytes);
  // Listeners are no longer notified, and leases are no longer renewed.
  void Stop();

  // Others no longer place sessions here, and no call waits for the database beyond `deadline`.
  // Blocks on the store.
  void BeginDraining(PostgresPool::Clock::time_point deadline);

  // Must outlive the page.
  void AddTo(MetricsPage* page);

 private:
  Cluster(const ClusterOptions& options, std::string name, PostgresStores* stores,
          std::unique_ptr<PostgresPool> pool);

  const std::unique_ptr<PostgresPool> pool_;
  PostgresStores* const stores_;
  ClusterNode node_;
  ClusterListeners rooms_;
  ExportLookups lookups_;
  std::unique_ptr<ChangeFollower> follower_;
};

}  // namespace tissueform
