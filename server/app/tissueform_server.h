// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"

#include "server/access/access.h"
#include "server/access/access_changes.h"
#include "server/access/auth/authenticator.h"
#include "server/access/auth/token_authenticator.h"
#include "server/access/link_authenticator.h"
#include "server/app/open_stores.h"
#include "server/app/server_options.h"
#include "server/builds/build_room.h"
#include "server/cluster/cluster.h"
#include "server/exports/export_queue.h"
#include "server/exports/export_store.h"
#include "server/platform/connection_listener.h"
#include "server/platform/rotated_files.h"
#include "server/rpc/access_service.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/case_service.h"
#include "server/rpc/deform_service.h"
#include "server/rpc/deform_streams.h"
#include "server/rpc/export_service.h"
#include "server/rpc/export_watch.h"
#include "server/rpc/mesh_service.h"
#include "server/rpc/plan_build_service.h"
#include "server/rpc/plan_service.h"
#include "server/rpc/prediction_service.h"
#include "server/rpc/server_info_service.h"
#include "server/rpc/session_service.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/deadline_timer.h"
#include "server/session/housekeeping.h"
#include "server/session/memory_budget.h"
#include "server/session/memory_reclaimer.h"
#include "server/session/mesh_catalog.h"
#include "server/session/mesh_uploads.h"
#include "server/session/session_registry.h"
#include "server/session/worker_pool.h"
#include "server/store/access_queries.h"
#include "server/store/sql_access_store.h"
#include "server/store/stores.h"
#include "server/telemetry/telemetry.h"

namespace tissueform {

// A running server: the only place where its objects are joined.
class TissueformServer {
 public:
  // Listens when it returns. Several servers may live in one process.
  //
  // Errors: Unavailable, naming the address, when it cannot be listened on; those of CheckExposure,
  // LoadServerFiles, TokenAuthenticator::Start and OpenStores.
  //
  // `authenticator`, which must outlive the server, says who calls; null: what the options say.
  static absl::StatusOr<std::unique_ptr<TissueformServer>> Start(
      const ServerOptions& options, Authenticator* authenticator = nullptr);

  // Cancels open calls, waits for them and ends.
  ~TissueformServer();

  // The port that is listened on, also when the options said 0.
  int port() const { return listener_->port(); }

  // The port on which Prometheus finds the page of metrics; 0: the page is not served.
  int metrics_port() const { return metrics_.has_value() ? metrics_->port() : 0; }

  // Ends in good order: health turns to NOT_SERVING, streams receive a notice (with the time of the
  // drain deadline), new work is refused with UNAVAILABLE; open calls may go on until the drain
  // deadline and are then cancelled; the listener closes. Blocks until all calls have ended. One
  // thread, once.
  //
  // A node of a cluster continues to serve for some seconds, in which proxies see its health; then
  // it hands its sessions to the others, and their streams end with SESSION_MOVED.
  void Drain();

  // Calls `answered` later, when the lanes that planners wait for have each done a job.
  void Ask(std::function<void()> answered);

  const MemoryBudget& memory_budget() const { return budget_; }
  Stores& stores() { return *stores_; }
  const SessionRegistry& sessions() const { return registry_; }
  const DeformStreams& streams() const { return streams_; }
  const SessionWatches& watches() const { return watches_; }
  const ExportWatches& export_watches() const { return export_watches_; }
  // Null without TLS.
  const RotatedFiles* tls_files() const { return tls_files_.get(); }
  // Strangers may reach it, and it is not protected from them: --insecure.
  bool is_exposed() const;
  // Null: there are no logins.
  const TokenAuthenticator* tokens() const { return tokens_.get(); }
  // Null without --store.
  Cluster* cluster() { return cluster_.get(); }

 private:
  // What is made before the server itself.
  struct Parts {
    std::unique_ptr<Telemetry> telemetry;
    std::unique_ptr<RotatedFiles> tls_files;     // null without TLS
    std::unique_ptr<TokenAuthenticator> tokens;  // null: none are configured
    Authenticator* authenticator = nullptr;      // null: there are no logins
    OpenedStores opened;
    std::unique_ptr<Cluster> cluster;   // null without --store
    std::unique_ptr<BuildRoom> builds;  // null where no plans are built
  };

  TissueformServer(const ServerOptions& options, Parts parts);

  absl::Status LoadIndex();
  absl::Status Listen();
  // Memory that sessions may still take, with the memory of unused sessions that can be evicted.
  int64_t FreeBytes() const;
  // Does nothing without --metrics-port.
  absl::Status ServeMetrics();
  SecurityReadings ReadSecurity() const;

  // Constant.
  const ServerOptions options_;

  // Self-synchronised; each may use those before it. Destroyed from the last to the first: calls
  // end, then jobs, then what they used.
  const std::unique_ptr<Telemetry> telemetry_;
  const std::unique_ptr<RotatedFiles> tls_files_;  // null without TLS
  const std::unique_ptr<TokenAuthenticator> tokens_;
  CallQuotas quotas_;
  std::unique_ptr<SqlAccessStore> access_store_;  // its rows are those of the stores
  std::unique_ptr<ExportStore> export_store_;     // as access_store_
  ExportQueue exports_;
  ExportWatches export_watches_;
  AccessQueries access_queries_;  // of the rows of the stores
  Access access_;
  AccessChanges access_changes_;
  std::unique_ptr<LinkAuthenticator> authenticator_;  // null: there are no logins
  std::unique_ptr<Cluster> cluster_;                  // null without --store
  AdmissionControl gate_;
  MemoryBudget budget_;
  std::unique_ptr<Stores> stores_;
  std::unique_ptr<BuildRoom> builds_;  // null where no plans are built; stores cases
  MeshCatalog catalog_;
  MeshUploads uploads_;
  std::unique_ptr<WorkerPool> pool_;
  SessionRegistry registry_;
  Housekeeping housekeeping_;
  DeformStreams streams_;
  SessionWatches watches_;
  MemoryReclaimer reclaimer_;  // sessions that it evicts notify streams and watches
  DeadlineTimer timer_;
  MeshService mesh_service_;
  SessionService session_service_;
  DeformService deform_service_;
  PredictionService prediction_service_;
  PlanService plan_service_;
  PlanBuildService plan_build_service_;
  CaseService case_service_;
  AccessService access_service_;
  ExportService export_service_;
  ServerInfoService server_info_service_;
  // gRPC gets its connections from the listener, through the acceptor. The server comes last: what
  // it is given goes to the acceptor of a server that lives.
  std::unique_ptr<ConnectionListener> listener_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor_;
  std::unique_ptr<grpc::Server> server_;
  std::optional<MetricsPage> metrics_;  // reads what the others count
};

}  // namespace tissueform
