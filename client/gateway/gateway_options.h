// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

#include "client/gateway/gateway_limits.h"
#include "client/gateway/login_config.h"
#include "core/base/certificates.h"

namespace tissueform {

// Everything that can be set about a gateway.
struct GatewayOptions {
  // Of the server, or of the HAProxy before several: HOST:PORT or unix:/PATH.
  std::string server;
  // Encryption to the servers: authorities of their certificates, and the gateway's own.
  // Empty: none.
  TlsFiles upstream = {};
  bool insecure = false;  // allow unencrypted connections to servers on other machines
  // Proxies whose X-Forwarded-For counts.
  std::vector<std::string> trusted_proxies = {};
  std::string host = "127.0.0.1";
  int port = 8080;  // 0: any free one
  std::string web;  // folder of the planner; empty: none is served
  std::vector<std::string> allowed_hosts;
  std::vector<std::string> allowed_origins;
  int threads = 2;
  GatewayLimits limits;
  LoginConfig login = {};
  std::string deviations = {};  // file of what surgery and model err by; empty: as published
  std::string log_level = "info";
  std::string log_format = "text";
  int metrics_port = -1;  // of loopback; 0: any free one; -1: no metrics
};

// Adds one option a setting to `app`, with its default in the help; parsing writes into `options`,
// which must outlive it. They may stand in a file and in the environment too (AddConfiguration).
void AddGatewayOptions(CLI::App& app, GatewayOptions* options);

}  // namespace tissueform
