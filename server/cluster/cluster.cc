// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/cluster.h"

#include <utility>

#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Counter = std::atomic<int64_t>;

void AddCalls(MetricsPage* page, const char* call, const char* outcome, const Counter& counter) {
  page->AddCounter("tissueform_lease_calls_total",
                   "Calls to the cluster's database about leases, by outcome "
                   "them.",
                   {{"call", call}, {"outcome", outcome}},
                   [&counter] { return static_cast<double>(counter); });
}

}  // namespace

absl::StatusOr<std::unique_ptr<Cluster>> Cluster::Open(const ClusterOptions& options, int port,
                                                       PostgresStores* stores) {
  const std::string name = options.node_name.empty() ? DefaultNodeName(port) : options.node_name;
  TF_RETURN_IF_ERROR(CheckNodeName(name));
  const PostgresOptions database = NodeOptionsOf(stores->pool()->options());
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresPool> pool, PostgresPool::Open(database));
  std::unique_ptr<Cluster> cluster(new Cluster(options, name, stores, std::move(pool)));
  // A database that cannot be written makes the start fail, not the first call.
  TF_RETURN_IF_ERROR(cluster->node_.nodes().Exchange());
  TF_ASSIGN_OR_RETURN(cluster->follower_, ChangeFollower::Start(database));
  spdlog::info("node {} of a cluster", name);
  return cluster;
}

Cluster::Cluster(const ClusterOptions& options, std::string name, PostgresStores* stores,
                 std::unique_ptr<PostgresPool> pool)
    : pool_(std::move(pool)), stores_(stores), node_(pool_.get(), options, std::move(name)) {}

void Cluster::Join(ClusterListeners rooms) {
  rooms.stores = stores_;
  rooms_ = rooms;
  rooms.exports->set_read_gate(
      [this](const std::string& id, const std::function<absl::Status()>& read) {
        return lookups_.Read(id, read);
      });
  rooms.sessions->loader().set_naming_room(
      [this](const absl::Status& refusal) { return node_.NamingRoom(refusal); });
  node_.set_on_lost([sessions = rooms.sessions](const std::string& id) { sessions->Lost(id); });
}

void Cluster::Start(std::function<int64_t()> free_bytes) {
  node_.Start(std::move(free_bytes));
  follower_->Begin(rooms_);
}

void Cluster::BeginDraining(PostgresPool::Clock::time_point deadline) {
  stores_->pool()->EndWaiting(deadline);
  pool_->EndWaiting(deadline);
  node_.nodes().SetDraining();
}

void Cluster::Stop() {
  follower_.reset();
  node_.Stop();
}

void Cluster::AddTo(MetricsPage* page) {
  const CountedLeases& leases = node_.leases();
  const CountedLeases::Counts& counts = leases.counts();
  AddCalls(page, "take", "mine", counts.taken);
  AddCalls(page, "take", "anothers", counts.refused);
  AddCalls(page, "take", "failed", counts.takings_failed);
  AddCalls(page, "renew", "done", counts.renewed);
  AddCalls(page, "renew", "failed", counts.renewals_failed);
  AddCalls(page, "release", "done", counts.released);
  AddCalls(page, "release", "failed", counts.releases_failed);
  page->AddGauge("tissueform_sessions_held", "Sessions that this server holds by a lease.", {},
                 [this] { return static_cast<double>(node_.held()); });
  page->AddCounter("tissueform_sessions_lost_total",
                   "Sessions whose lease expired without being returned.", {},
                   [this] { return static_cast<double>(node_.lost()); });
  page->AddGauge("tissueform_lease_renewal_age_seconds",
                 "Seconds since the last lease renewal; above 9 the node answers nothing.", {},
                 [&leases] { return leases.SinceRenewal().count(); });
  page->AddGauge("tissueform_other_nodes", "Other active servers of the cluster.", {},
                 [this] { return static_cast<double>(node_.nodes().CountOthers()); });
  page->AddGauge("tissueform_node_name_taken", "1 while another server has this one's name.", {},
                 [this] { return node_.nodes().IsNameTaken() ? 1.0 : 0.0; });
  page->AddCounter("tissueform_row_lookups_total",
                   "Database lookups of exports that this node did not know.", {},
                   [this] { return static_cast<double>(lookups_.lookups()); });
}

}  // namespace tissueform
