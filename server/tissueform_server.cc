// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/tissueform_server.h"

#include <mutex>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/resource_quota.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server_builder.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "core/linear_solvers/blas_threads.h"
#include "server/library_logs.h"

namespace tissueform {
namespace {

// Keeps gRPC's own buffers bounded beside the memory budget.
constexpr size_t kTransportQuotaBytes = size_t{512} << 20;
// Chunks are 1 MiB at most; regions of a mesh of a million vertices fit too.
constexpr int kMaxReceiveBytes = 4 << 20;
constexpr int kKeepaliveMilliseconds = 25'000;
constexpr int kKeepaliveTimeoutMilliseconds = 10'000;
constexpr int kMinClientPingMilliseconds = 10'000;
// For what was finished just now to leave the buffers.
constexpr std::chrono::milliseconds kLastMessagesGrace{500};

void PrepareProcessOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    RouteLibraryLogs();
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  });
}

void SetTransportLimits(const ServerOptions& options, grpc::ServerBuilder* builder) {
  builder->SetResourceQuota(grpc::ResourceQuota("tissueform").Resize(kTransportQuotaBytes));
  builder->SetMaxReceiveMessageSize(kMaxReceiveBytes);
  builder->SetMaxSendMessageSize(-1);  // an answer is as large as its mesh
  builder->AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, options.max_calls_per_connection);
  // A client whose machine is gone is noticed, and its stream ends.
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
  builder->AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMilliseconds);
  builder->AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                              kMinClientPingMilliseconds);
  // Two servers on one port would take turns at answering; the second one shall fail instead.
  builder->AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
}

std::string Address(const ServerOptions& options) {
  const bool is_ipv6 = absl::StrContains(options.host, ":");
  return absl::StrCat(is_ipv6 ? "[" : "", options.host, is_ipv6 ? "]:" : ":", options.port);
}

}  // namespace

absl::StatusOr<std::unique_ptr<TissueformServer>> TissueformServer::Start(
    const ServerOptions& options) {
  std::unique_ptr<TissueformServer> server(new TissueformServer(options));
  TF_RETURN_IF_ERROR(server->Listen());
  return server;
}

TissueformServer::TissueformServer(const ServerOptions& options)
    : options_(options),
      budget_(options.memory_budget_bytes),
      catalog_(options.limits, &budget_),
      pool_(std::make_unique<WorkerPool>(options.workers)),
      registry_(options.limits, &budget_, pool_.get(), &store_),
      streams_(options.limits.max_streams),
      mesh_service_(&gate_, options.limits, &catalog_, pool_.get(), &timer_),
      session_service_(&gate_, options.limits, &catalog_, &registry_),
      deform_service_(&gate_, options.limits, &registry_, &streams_, &timer_) {
  SetBlasThreads(1);  // the pool's workers share the cores already
  budget_.set_reclaimer([this] { Reclaim(); });
}

TissueformServer::~TissueformServer() {
  if (server_ != nullptr) {
    server_->Shutdown(std::chrono::system_clock::now());
    server_->Wait();
    server_.reset();
  }
  pool_.reset();  // its last jobs may still use the registry
}

absl::Status TissueformServer::Listen() {
  PrepareProcessOnce();
  grpc::ServerBuilder builder;
  SetTransportLimits(options_, &builder);
  builder.AddListeningPort(Address(options_), grpc::InsecureServerCredentials(), &port_);
  builder.RegisterService(&mesh_service_);
  builder.RegisterService(&session_service_);
  builder.RegisterService(&deform_service_);
  server_ = builder.BuildAndStart();
  if (server_ == nullptr || port_ == 0) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", Address(options_),
                     ": the port is taken or the address is not this machine's; choose another "
                     "--port or --host"));
  }
  return absl::OkStatus();
}

void TissueformServer::Reclaim() {
  registry_.RemoveIdle();
  // Afterwards: a mesh is idle only when no session holds it.
  if (const int count = catalog_.RemoveIdle(); count > 0) {
    spdlog::info("removed {} meshes that were idle for more than {} s", count,
                 options_.limits.session_idle_ttl.count());
  }
}

void TissueformServer::Drain() {
  const auto deadline = std::chrono::steady_clock::now() + options_.drain_deadline;
  spdlog::info("draining: {} open streams, at most {} s", streams_.size(),
               options_.drain_deadline.count());
  server_->GetHealthCheckService()->SetServingStatus(false);
  gate_.StartDraining();
  streams_.NotifyDraining();
  if (!gate_.WaitUntilIdle(deadline)) {
    spdlog::warn("draining: cancelling the calls that are still open");
  }
  // Only now: a server that shuts down answers CANCELLED instead of UNAVAILABLE, and waits for idle
  // connections to be closed by their clients.
  server_->Shutdown(std::chrono::system_clock::now() + kLastMessagesGrace);
  server_->Wait();
}

}  // namespace tissueform
