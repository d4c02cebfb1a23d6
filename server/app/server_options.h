// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "CLI/CLI.hpp"

#include "server/access/access_options.h"
#include "server/access/auth/token_options.h"
#include "server/builds/build_limits.h"
#include "server/cluster/cluster_options.h"
#include "server/exports/export_queue.h"
#include "server/platform/tls_options.h"
#include "server/session/limits.h"
#include "server/session/quotas.h"
#include "server/telemetry/telemetry_options.h"

namespace tissueform {

// Everything that can be set about a server.
struct ServerOptions {
  std::string host = "127.0.0.1";
  int port = 50051;  // 0: any free one
  TlsOptions tls = {};
  int64_t memory_budget_bytes = 0;
  int workers = 1;
  ServiceLimits limits;
  Quotas quotas = {};
  int max_calls_per_connection = 128;
  int max_connections = 1024;
  int max_connections_per_address = 512;
  std::chrono::seconds drain_deadline{20};
  // Nothing outlives the process. True for a server in a test; the program keeps what it
  // acknowledges unless it runs with --in-memory.
  bool in_memory = true;
  std::string data_dir;  // empty: DefaultDataFolder
  ClusterOptions cluster = {};
  std::string log_level = "info";
  TokenOptions tokens = {};
  TelemetryOptions telemetry = {};
  AccessOptions access = {};
  ExportLimits exports = {};
  PlanBuildLimits plan_builds = {};

  // Half of the machine's memory, one worker a core.
  static ServerOptions Defaults();
};

// Adds one option a setting to `app`, with its default in the help; parsing writes into `options`,
// which must outlive it. They may stand in a file and in the environment too (AddConfiguration).
void AddServerOptions(CLI::App& app, ServerOptions* options);

}  // namespace tissueform
