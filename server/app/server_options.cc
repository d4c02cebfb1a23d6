// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/server_options.h"

#include <algorithm>
#include <thread>
#include <unistd.h>

#include "server/app/number_options.h"
#include "server/platform/program_options.h"

namespace tissueform {

ServerOptions ServerOptions::Defaults() {
  ServerOptions options;
  options.memory_budget_bytes =
      static_cast<int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGE_SIZE) / 2;
  options.workers = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return options;
}

void AddServerOptions(CLI::App& app, ServerOptions* options) {
  app.add_option(
         "--host", options->host,
         "address to listen on; other addresses than loopback need encryption and logins, or "
         "--insecure")
      ->capture_default_str();
  app.add_option("--port", options->port, "port to listen on; 0 takes a free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  AddTlsOptions(app, &options->tls);
  options->in_memory = false;
  CLI::Option* in_memory = app.add_flag("--in-memory", options->in_memory,
                                        "store nothing: meshes and sessions end with the server");
  CLI::Option* data_dir =
      app.add_option(
             "--data-dir", options->data_dir,
             "private folder for everything the server acknowledges, on a disk of "
             "this machine (default: $XDG_STATE_HOME/tissueform, or ~/.local/state/tissueform)")
          ->type_name("DIR")
          ->excludes(in_memory);
  AddClusterOptions(app, &options->cluster, data_dir, in_memory);
  AddTokenOptions(app, &options->tokens);
  AddNumberOptions(app, options);
  app.add_option("--log-level", options->log_level,
                 "log level on stderr; names and paths are never logged")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  AddTelemetryOptions(app, &options->telemetry);
  AddConfiguration(app, "TISSUEFORM_SERVER_");  // last: it looks at all options
}

}  // namespace tissueform
