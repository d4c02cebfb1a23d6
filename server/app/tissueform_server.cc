// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/tissueform_server.h"

#include <algorithm>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "grpc/health/v1/health.pb.h"
#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/resource_quota.h"
#include "grpcpp/server_builder.h"
#include "spdlog/spdlog.h"

#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "server/app/library_logs.h"
#include "server/app/number_options.h"
#include "server/builds/plan_builder.h"
#include "server/platform/network_address.h"
#include "server/platform/process_metrics.h"
#include "server/platform/tls_credentials.h"
#include "server/telemetry/server_metrics.h"

namespace tissueform {
namespace {

// Keeps gRPC's own buffers bounded beside the memory budget.
constexpr size_t kTransportQuotaBytes = size_t{512} << 20;
// Chunks are 1 MiB at most; regions of a mesh of a million vertices fit too.
// A token of 8 KiB, and what else a client says of itself; longer headers gRPC refuses.
constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kKeepaliveMilliseconds = 25'000;
constexpr int kKeepaliveTimeoutMilliseconds = 10'000;
constexpr int kMinClientPingMilliseconds = 10'000;
constexpr int kHandshakeMilliseconds = 10'000;
// For what was finished just now to leave the buffers.
constexpr std::chrono::milliseconds kLastMessagesGrace{500};

// Proxies check the health every second; calls that they still send here until then are served.
constexpr std::chrono::seconds kUntilProxiesSee{3};

void PrepareProcessOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    RouteLibraryLogs();
    grpc::EnableDefaultHealthCheckService(true);
    // gRPC's health service has no descriptor of its own; without one, clients that ask reflection
    // for every service's schema end at it (buf curl --list-methods).
    google::protobuf::LinkMessageReflection<grpc::health::v1::HealthCheckRequest>();
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

void SetTransportLimits(const ServerOptions& options, grpc::ServerBuilder* builder) {
  builder->SetResourceQuota(grpc::ResourceQuota("tissueform").Resize(kTransportQuotaBytes));
  builder->SetMaxReceiveMessageSize(kMaxReceiveBytes);
  builder->SetMaxSendMessageSize(-1);  // an answer is as large as its mesh
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, options.max_calls_per_connection);
  builder->AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  // A client whose machine is gone is noticed, and its stream ends.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMilliseconds);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                              kMinClientPingMilliseconds);
  // Who connects and says nothing does not hold a place for long.
  builder->AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeMilliseconds);
}

// What the process needs beside connections: libraries, logs, helper processes, gRPC's own.
constexpr int kOtherDescriptors = 100;

ConnectionListener::Options ListenerOptions(const ServerOptions& options) {
  const int descriptors = std::max(RaiseDescriptorLimit() - kOtherDescriptors, 1);
  return {.host = options.host,
          .port = options.port,
          .most = std::min(options.max_connections, descriptors),
          .most_of_address = options.max_connections_per_address};
}

absl::StatusOr<std::unique_ptr<Telemetry>> StartTelemetry(const ServerOptions& options) {
  std::string folder;
  if (!options.in_memory && !options.cluster.enabled()) {
    TF_ASSIGN_OR_RETURN(folder, DataFolderOf(options));
  }
  return Telemetry::Start(options.telemetry,
                          {.certificate = options.tls.certificate, .key = options.tls.key}, folder);
}

// Null where no plans are built: without the programs every build would fail after its upload.
// A node of a cluster has no data folder: what it builds is forgotten when it ends, and HAProxy
// sends all calls of a person for builds to one node (deploy/haproxy/cluster.cfg).
absl::StatusOr<std::unique_ptr<BuildRoom>> OpenBuilds(const ServerOptions& options,
                                                      CaseStore* cases) {
  const PlanBuildLimits& limits = options.plan_builds;
  if (limits.at_once == 0) return nullptr;
  if (const absl::Status programs = CheckPlanBuildPrograms(); !programs.ok()) {
    spdlog::info("{}", std::string(programs.message()));
    return nullptr;
  }
  std::string folder;
  if (!options.in_memory && !options.cluster.enabled()) {
    TF_ASSIGN_OR_RETURN(folder, DataFolderOf(options));
    folder += "/builds";
  }
  const int threads = std::max(1, options.workers / limits.at_once);
  return BuildRoom::Open(std::move(folder), limits, threads, cases, options.limits.max_cases);
}

}  // namespace

absl::StatusOr<std::unique_ptr<TissueformServer>> TissueformServer::Start(
    const ServerOptions& options, Authenticator* authenticator) {
  const bool has_logins = authenticator != nullptr || options.tokens.configured();
  TF_RETURN_IF_ERROR(CheckExposure(options.host, options.tls, has_logins));
  Parts parts;
  TF_ASSIGN_OR_RETURN(parts.tls_files, LoadServerFiles(options.tls));
  if (options.tokens.configured()) {
    TF_ASSIGN_OR_RETURN(parts.tokens, TokenAuthenticator::Start(options.tokens));
  }
  parts.authenticator = authenticator != nullptr ? authenticator : parts.tokens.get();
  TF_ASSIGN_OR_RETURN(parts.opened, OpenStores(options));
  // After the stores, which lock the data folder.
  TF_ASSIGN_OR_RETURN(parts.builds, OpenBuilds(options, &parts.opened.stores->cases()));
  TF_ASSIGN_OR_RETURN(parts.telemetry, StartTelemetry(options));
  if (parts.opened.shared != nullptr) {
    TF_ASSIGN_OR_RETURN(parts.cluster,
                        Cluster::Open(options.cluster, options.port, parts.opened.shared));
  }
  std::unique_ptr<TissueformServer> server(new TissueformServer(options, std::move(parts)));
  if (server->is_exposed()) {
    spdlog::warn("INSECURE: {}, and the server is reachable over the network (--insecure)",
                 options.tls.enabled() ? "logins are disabled" : "calls are not encrypted");
  }
  TF_RETURN_IF_ERROR(server->LoadIndex());
  server->housekeeping_.Start();
  TF_RETURN_IF_ERROR(server->ServeMetrics());
  TF_RETURN_IF_ERROR(server->Listen());
  if (server->cluster_ != nullptr) {
    server->cluster_->Start([raw = server.get()] { return raw->FreeBytes(); });
  }
  return server;
}

absl::Status TissueformServer::LoadIndex() {
  // What is not known to be gone stays.
  TF_RETURN_IF_ERROR(exports_.LoadAll([&](const std::string& id) {
    return !absl::IsNotFound(stores_->predictions().Get(id).status());
  }));
  TF_RETURN_IF_ERROR(registry_.sync().LearnAll());
  return absl::OkStatus();
}

TissueformServer::TissueformServer(const ServerOptions& options, Parts parts)
    : options_(options),
      telemetry_(std::move(parts.telemetry)),
      tls_files_(std::move(parts.tls_files)),
      tokens_(std::move(parts.tokens)),
      quotas_(options.quotas),
      access_store_(std::move(parts.opened.access)),
      export_store_(std::move(parts.opened.exports)),
      exports_(options.exports, export_store_.get(), [this] { return stores_->NowS(); }),
      export_watches_(options.exports.max_watches),
      access_queries_(&parts.opened.stores->database()),
      access_(
          &access_queries_, [this] { return stores_->NowS(); }, &exports_),
      access_changes_(options.access, access_store_.get(), &access_),
      authenticator_(parts.authenticator == nullptr
                         ? nullptr
                         : std::make_unique<LinkAuthenticator>(&access_, parts.authenticator)),
      cluster_(std::move(parts.cluster)),
      gate_({.authenticator = authenticator_.get(),
             .may_call = &Access::CheckMethodAccess,
             .observer = telemetry_.get(),
             .quotas = &quotas_,
             .gateway_name = options.tls.gateway_name,
             .node_name = cluster_ == nullptr ? "" : cluster_->name()}),
      budget_(options.memory_budget_bytes),
      stores_(std::move(parts.opened.stores)),
      builds_(std::move(parts.builds)),
      catalog_(options.limits, &budget_, stores_->keeps() ? &stores_->meshes() : nullptr,
               Clock::System(), [stores = stores_.get()] { return stores->NowS(); }),
      uploads_(options.limits, &catalog_, &stores_->uploads()),
      pool_(std::make_unique<WorkerPool>(options.workers)),
      registry_(options.limits, &budget_, pool_.get(), &stores_->sessions(), &catalog_,
                Clock::System(), cluster_ == nullptr ? nullptr : &cluster_->node()),
      housekeeping_(
          {.retention_days = options.limits.retention_days,
           .export_retention_days = options.exports.retention_days,
           .remove_exports = [this](int64_t before_s,
                                    int most) { return exports_.RemoveUnchanged(before_s, most); }},
          stores_.get(), &registry_, &catalog_),
      streams_(options.limits.max_streams),
      watches_(options.limits, pool_.get()),
      reclaimer_(options.limits, &budget_, &registry_, &catalog_),
      mesh_service_(&gate_, options.limits, &access_changes_, &catalog_, &uploads_, &registry_,
                    pool_.get(), &timer_),
      session_service_(&gate_, options.limits, &access_, &catalog_, &registry_),
      deform_service_(&gate_, options.limits, &access_, &registry_, &streams_, &watches_, &timer_),
      prediction_service_(&gate_, options.limits, &access_, &catalog_, &registry_,
                          &stores_->predictions(), &exports_, &timer_),
      plan_service_(&gate_, &access_, &registry_),
      plan_build_service_(&gate_, options.limits, &access_, builds_.get(),
                          !options.cluster.enabled(), pool_.get(), &timer_),
      case_service_(&gate_, options.limits, &access_, &stores_->cases(), pool_.get(), &timer_),
      access_service_(&gate_, &access_changes_, &registry_, &streams_, &watches_,
                      [this] { return stores_->NowS(); }),
      export_service_(&gate_, options.limits, &access_, &stores_->predictions(), &exports_,
                      &export_watches_, pool_.get(), &timer_),
      server_info_service_(&gate_, LimitsOf(options)) {
  SetBlasThreads(1);  // the pool's workers share the cores already
  registry_.table().set_observer([this](const std::string& id, SessionEvent event) {
    telemetry_->session_events().Count(event);
    streams_.OnSessionEvent(id, event);
    watches_.OnSessionEvent(id, event);
    access_.ForgetLinks();
  });
  // A store that keeps meshes removes the rights with them.
  if (!stores_->keeps()) {
    catalog_.set_on_removed(
        [this](const std::string& sha256) { access_changes_.MeshRemoved(sha256); });
  }
  exports_.set_on_changed(
      [this](const ExportRecord& record) { export_watches_.OnChanged(record); });
  access_.set_most_bytes(options.quotas.disk_bytes);
  registry_.table().set_max_of_owner(options.quotas.sessions);
  budget_.set_account_limit(MemoryQuota(options));
  if (cluster_ != nullptr) {
    cluster_->Join({.sessions = &registry_, .meshes = &catalog_, .exports = &exports_});
  }
}

TissueformServer::~TissueformServer() {
  metrics_.reset();
  if (cluster_ != nullptr) cluster_->Stop();
  if (server_ != nullptr) {
    listener_->Stop();
    server_->Shutdown(std::chrono::system_clock::now());
    server_->Wait();
    server_.reset();
  }
  housekeeping_.Stop();
  registry_.Stop();
  pool_.reset();    // its last jobs may still use the registry and the store
  stores_.reset();  // its last answers may still use the registry
}

absl::Status TissueformServer::ServeMetrics() {
  if (options_.telemetry.metrics_port < 0) return absl::OkStatus();
  metrics_.emplace();
  AddProcessMetrics("tissueform", SoftwareVersion(), &*metrics_);
  telemetry_->AddTo(&*metrics_);
  AddFrameMetrics(streams_.measures(), &*metrics_);
  AddLaneMetrics(*pool_, &*metrics_);
  AddSessionMetrics(registry_, telemetry_->session_events(), &*metrics_);
  AddMemoryMetrics(budget_, catalog_, &*metrics_);
  AddStoreMetrics(*stores_, &*metrics_);
  AddSecurityMetrics(ReadSecurity(), &*metrics_);
  if (cluster_ != nullptr) cluster_->AddTo(&*metrics_);
  metrics_->AddGauge("tissueform_streams", "Drags open.", {},
                     [this] { return static_cast<double>(streams_.size()); });
  metrics_->AddGauge("tissueform_watches", "Watches open.", {},
                     [this] { return static_cast<double>(watches_.size()); });
  metrics_->AddGauge("tissueform_exports_waiting", "Exports to the PACS in progress.", {},
                     [this] { return static_cast<double>(exports_.CountWaiting()); });
  metrics_->AddGauge("tissueform_export_watches", "Watches of exports open.", {},
                     [this] { return static_cast<double>(export_watches_.size()); });
  metrics_->AddGauge("tissueform_draining", "1 while the server drains.", {},
                     [this] { return gate_.draining() ? 1.0 : 0.0; });
  TF_RETURN_IF_ERROR(metrics_->Serve(options_.telemetry.metrics_port));
  spdlog::info("metrics on http://127.0.0.1:{}/metrics", metrics_->port());
  return absl::OkStatus();
}

SecurityReadings TissueformServer::ReadSecurity() const {
  SecurityReadings readings = {.insecure = is_exposed()};
  if (tls_files_ != nullptr && tls_files_->has_identity()) {
    readings.certificate_expires = [this] {
      return std::chrono::duration<double>(tls_files_->expiry().time_since_epoch()).count();
    };
    readings.certificate_alarm = [this] { return tls_files_->alarm() ? 1.0 : 0.0; };
  }
  if (tokens_ == nullptr) return readings;
  readings.token_keys_alarm = [this] { return tokens_->standing().keys_alarm ? 1.0 : 0.0; };
  readings.revocations_alarm = [this] { return tokens_->standing().revocations_alarm ? 1.0 : 0.0; };
  readings.alarms = [this] { return static_cast<double>(tokens_->standing().alarms); };
  if (!options_.tokens.jwks_url.empty()) {  // a file is read when it changes, which may be never
    readings.token_keys_read = [this] {
      return static_cast<double>(
          std::chrono::system_clock::to_time_t(tokens_->standing().keys_read));
    };
  }
  for (const auto& [reason, count] : tokens_->failures().Counts()) {
    readings.token_failures[reason] = [this, reason = reason] {
      return static_cast<double>(tokens_->failures().Counts().at(reason));
    };
  }
  return readings;
}

absl::Status TissueformServer::Listen() {
  PrepareProcessOnce();
  TF_ASSIGN_OR_RETURN(listener_, ConnectionListener::Listen(ListenerOptions(options_)));
  grpc::ServerBuilder builder;
  SetTransportLimits(options_, &builder);
  acceptor_ = builder.experimental().AddExternalConnectionAcceptor(
      grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
      MakeServerCredentials(options_.tls, tls_files_.get()));
  builder.RegisterService(&mesh_service_);
  builder.RegisterService(&session_service_);
  builder.RegisterService(&deform_service_);
  builder.RegisterService(&prediction_service_);
  builder.RegisterService(&plan_service_);
  builder.RegisterService(&plan_build_service_);
  builder.RegisterService(&case_service_);
  builder.RegisterService(&access_service_);
  builder.RegisterService(&export_service_);
  builder.RegisterService(&server_info_service_);
  server_ = builder.BuildAndStart();
  if (server_ == nullptr) return absl::InternalError("gRPC does not start");
  if (cluster_ != nullptr) {
    // Proxies send calls to servers that can take a session; streams stay while leases last.
    cluster_->node().nodes().ObserveReach([health = server_->GetHealthCheckService()](
                                              bool reached) { health->SetServingStatus(reached); });
  }
  listener_->Start([this](int fd, int listener_fd) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
    connection.fd = fd;
    connection.listener_fd = listener_fd;
    acceptor_->HandleNewConnection(&connection);
  });
  return absl::OkStatus();
}

bool TissueformServer::is_exposed() const {
  return !IsLoopback(options_.host) && !(options_.tls.enabled() && tokens_ != nullptr);
}

int64_t TissueformServer::FreeBytes() const {
  const int64_t reserved = budget_.reserved_bytes();
  return budget_.limit_bytes() - reserved + registry_.table().EvictableBytes();
}

void TissueformServer::Ask(std::function<void()> answered) {
  // Not the others: a factorisation, or a disk, may take long and is no reason to start again.
  pool_->Post(Lane::kFrames, [this, answered = std::move(answered)]() mutable {
    pool_->Post(Lane::kSolves, std::move(answered));
  });
}

void TissueformServer::Drain() {
  const auto deadline = std::chrono::steady_clock::now() + options_.drain_deadline;
  spdlog::info("draining: {} open streams, at most {} s", streams_.size(),
               options_.drain_deadline.count());
  // Calls that wait for an unreachable database fail while clients still receive the reason.
  if (cluster_ != nullptr) cluster_->BeginDraining(deadline - options_.drain_deadline / 10);
  server_->GetHealthCheckService()->SetServingStatus(false);
  if (cluster_ != nullptr) {
    std::this_thread::sleep_for(
        std::min<std::chrono::milliseconds>(kUntilProxiesSee, options_.drain_deadline / 4));
  }
  gate_.StartDraining();
  if (cluster_ != nullptr) {
    registry_.HandOver(deadline);
  } else {
    const auto end = std::chrono::system_clock::now() + options_.drain_deadline;
    streams_.NotifyDraining(end);
    watches_.NotifyDraining(end);
  }
  export_watches_.NotifyDraining();
  if (!gate_.WaitUntilIdle(deadline)) {
    spdlog::warn("draining: canceling open calls");
  }
  housekeeping_.Stop();
  listener_->Stop();
  // Only now: a server that shuts down answers CANCELLED instead of UNAVAILABLE, and waits for idle
  // connections to be closed by their clients.
  server_->Shutdown(std::chrono::system_clock::now() + kLastMessagesGrace);
  server_->Wait();
}

}  // namespace tissueform
