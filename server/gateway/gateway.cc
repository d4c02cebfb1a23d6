// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/gateway/gateway.h"

#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "server/monitoring/process_metrics.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<Gateway>> Gateway::Start(const GatewayOptions& options) {
  WebFiles files;
  if (!options.web.empty()) {
    TF_ASSIGN_OR_RETURN(files, WebFiles::Load(options.web));
  }
  auto gateway = absl::WrapUnique(new Gateway(options, std::move(files)));
  TF_ASSIGN_OR_RETURN(gateway->http_, HttpServer::Start({.host = options.host,
                                                         .port = options.port,
                                                         .threads = options.threads,
                                                         .limits = options.limits},
                                                        &gateway->routes_, &gateway->counters_));
  TF_RETURN_IF_ERROR(gateway->ServeMetrics());
  return gateway;
}

Gateway::Gateway(const GatewayOptions& options, WebFiles files)
    : options_(options),
      pool_(options.servers, options.limits),
      routes_(AccessRules(options.host, options.allowed_hosts, options.allowed_origins),
              std::move(files), &pool_, &counters_) {}

absl::Status Gateway::ServeMetrics() {
  if (options_.metrics_port < 0) return absl::OkStatus();
  metrics_.emplace();
  AddProcessMetrics("tissueform_gateway", SoftwareVersion(), &*metrics_);
  AddCounterMetrics(counters_, &*metrics_);
  metrics_->AddGauge("tissueform_gateway_ready", "1 while a server behind it takes calls.", {},
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
