// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/cluster/cluster_options.h"
#include "server/cluster/counted_leases.h"
#include "server/cluster/node_table.h"
#include "server/session/session_lease_table.h"
#include "server/store/postgres_store/lease_keeper.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/postgres_store/postgres_session_leases.h"

namespace tissueform {

// This server as one of several: the sessions that it holds, by leases, and its row among the
// nodes.
//
// Thread-safe.
class ClusterNode final : public SessionOwnership {
 public:
  // `pool` must outlive it.
  ClusterNode(PostgresPool* pool, const ClusterOptions& options, std::string name);

  // `on_lost` is called with each session that this server held and holds no longer, without a lock
  // held. Before Start.
  void set_on_lost(std::function<void(const std::string& id)> on_lost) {
    on_lost_ = std::move(on_lost);
  }
  // From now on leases are renewed, and other servers see this one. `free_bytes` says how much
  // memory sessions may still take here. Once.
  void Start(std::function<int64_t()> free_bytes);
  // Ends both; `on_lost` is no longer called.
  void Stop();

  const std::string& name() const { return name_; }
  NodeTable& nodes() { return nodes_; }
  const CountedLeases& leases() const { return counted_; }
  // Sessions that were held and no longer are, without having been given away.
  int64_t lost() const { return lost_; }
  int held() { return keeper_.CountHeld(); }

  absl::StatusOr<int64_t> Acquire(const std::string& id) override;
  std::optional<int64_t> EpochOf(const std::string& id) override { return keeper_.EpochOf(id); }
  void Forget(const std::string& id) override { keeper_.Forget(id); }
  void Release(const std::string& id) override;

  // `refusal`, with the node that has room where it says that memory is full here.
  absl::Status NamingRoom(const absl::Status& refusal);

 private:
  const std::string name_;
  std::function<void(const std::string&)> on_lost_ = [](const std::string& /*id*/) {};
  std::atomic<int64_t> lost_ = 0;

  PostgresSessionLeases leases_;
  CountedLeases counted_;
  NodeTable nodes_;
  LeaseKeeper keeper_;  // last: its thread uses the others
};

}  // namespace tissueform
