// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

#include "server/gateway/gateway_limits.h"

namespace tissueform {

// Everything that can be set about a gateway.
struct GatewayOptions {
  std::vector<std::string> servers;  // as gRPC has addresses
  std::string host = "127.0.0.1";
  int port = 8080;  // 0: any free one
  std::string web;  // folder of the planner; empty: none is served
  std::vector<std::string> allowed_hosts;
  std::vector<std::string> allowed_origins;
  int threads = 2;
  GatewayLimits limits;
  std::string log_level = "info";
  std::string log_format = "text";
  int metrics_port = -1;  // of loopback; 0: any free one; -1: no metrics
};

// Adds one option a setting to `app`, with its default in the help; parsing writes into `options`,
// which must outlive it. A config file in TOML or INI form with the same names may be given by
// --config.
void AddGatewayOptions(CLI::App& app, GatewayOptions* options);

}  // namespace tissueform
