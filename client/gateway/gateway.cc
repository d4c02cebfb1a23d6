// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway.h"

#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "client/gateway/page_config.h"
#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "server/platform/network_address.h"
#include "server/platform/process_metrics.h"
#include "server/platform/tls_credentials.h"

namespace tissueform {

namespace {

absl::Status CheckServer(const GatewayOptions& options) {
  const std::string& server = options.server;
  if (options.insecure || !options.upstream.authorities.empty()) return absl::OkStatus();
  std::string host = server.substr(0, server.rfind(':'));
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  if (absl::StartsWith(server, "unix:") || IsLoopback(host)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("--server ", server,
                   " is another machine, and tokens are sent there; give "
                   "--server-ca FILE, or --insecure if the network between "
                   "is isolated"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Gateway>> Gateway::Start(const GatewayOptions& options) {
  TF_RETURN_IF_ERROR(CheckLoginConfig(options.login));
  TF_RETURN_IF_ERROR(CheckServer(options));
  TF_RETURN_IF_ERROR(ForwardedAddresses::CheckProxies(options.trusted_proxies));
  std::unique_ptr<RotatedFiles> tls_files;
  if (!options.upstream.authorities.empty()) {
    TF_ASSIGN_OR_RETURN(tls_files, RotatedFiles::Load(options.upstream));
  }
  WebFiles files;
  if (!options.web.empty()) {
    TF_ASSIGN_OR_RETURN(files, WebFiles::Load(options.web));
  }
  TF_ASSIGN_OR_RETURN(std::string page_config, PageConfigJson(options.login, options.deviations));
  auto gateway = absl::WrapUnique(
      new Gateway(options, std::move(files), std::move(page_config), std::move(tls_files)));
  TF_ASSIGN_OR_RETURN(gateway->http_, HttpServer::Start({.host = options.host,
                                                         .port = options.port,
                                                         .threads = options.threads,
                                                         .limits = options.limits},
                                                        &gateway->routes_, &gateway->counters_));
  TF_RETURN_IF_ERROR(gateway->ServeMetrics());
  return gateway;
}

Gateway::Gateway(const GatewayOptions& options, WebFiles files, std::string page_config,
                 std::unique_ptr<RotatedFiles> tls_files)
    : options_(options),
      tls_files_(std::move(tls_files)),
      pool_(options.server, options.limits, MakeChannelCredentials(tls_files_.get())),
      routes_(AccessRules(options.host, options.allowed_hosts, options.allowed_origins),
              ForwardedAddresses(options.trusted_proxies), std::move(files), options.login,
              std::move(page_config), &pool_, &counters_) {}

absl::Status Gateway::ServeMetrics() {
  if (options_.metrics_port < 0) return absl::OkStatus();
  metrics_.emplace();
  AddProcessMetrics("tissueform_gateway", SoftwareVersion(), &*metrics_);
  AddCounterMetrics(counters_, &*metrics_);
  metrics_->AddGauge("tissueform_gateway_ready", "1 while a server accepts calls.", {},
                     [this] { return pool_.IsReady() ? 1.0 : 0.0; });
  TF_RETURN_IF_ERROR(metrics_->Serve(options_.metrics_port));
  spdlog::info("metrics on http://127.0.0.1:{}/metrics", metrics_->port());
  return absl::OkStatus();
}

std::string Gateway::Url() const {
  const bool is_ipv6 = absl::StrContains(options_.host, ':');
  return absl::StrCat("http://", is_ipv6 ? "[" : "", options_.host, is_ipv6 ? "]:" : ":", port());
}

}  // namespace tissueform
