// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "client/gateway/gateway_counters.h"
#include "client/gateway/gateway_options.h"
#include "client/gateway/gateway_routes.h"
#include "client/gateway/http_server.h"
#include "client/gateway/upstream_pool.h"
#include "server/platform/metrics_page.h"
#include "server/platform/rotated_files.h"

namespace tissueform {

// A running gateway: the only place where its objects are joined.
class Gateway {
 public:
  // Listens when it returns; the server need not be there yet.
  //
  // Errors: Unavailable, naming the address, when it cannot be listened on; FailedPrecondition
  // (a server on another machine without encryption); those of CheckLoginConfig, WebFiles::Load,
  // RotatedFiles::Load, ForwardedAddresses::CheckProxies and MetricsPage::Serve.
  static absl::StatusOr<std::unique_ptr<Gateway>> Start(const GatewayOptions& options);

  // "http://127.0.0.1:8080", also when the options said port 0.
  std::string Url() const;
  int port() const { return http_->port(); }
  // Calls `answered` on one of the threads that serve, later: proof that they do.
  void Ask(std::function<void()> answered) { http_->Post(std::move(answered)); }
  // The port on which Prometheus finds the page of metrics; 0: the page is not served.
  int metrics_port() const { return metrics_.has_value() ? metrics_->port() : 0; }
  const GatewayCounters& counters() const { return counters_; }
  const UpstreamPool& pool() const { return pool_; }

  // Shuts down gracefully: nothing more is accepted, every call receives UNAVAILABLE, sockets get
  // their end frame and close with 1001. Blocks until done, or its deadline. One thread, once.
  void Drain() { http_->Drain(); }

 private:
  Gateway(const GatewayOptions& options, WebFiles files, std::string page_config,
          std::unique_ptr<RotatedFiles> tls_files);

  absl::Status ServeMetrics();

  // Constant.
  const GatewayOptions options_;

  // Self-synchronised; each may use those before it, and is destroyed before them.
  const std::unique_ptr<RotatedFiles> tls_files_;  // null: no encryption
  GatewayCounters counters_;
  UpstreamPool pool_;
  GatewayRoutes routes_;
  std::unique_ptr<HttpServer> http_;
  std::optional<MetricsPage> metrics_;  // reads what the others count
};

}  // namespace tissueform
