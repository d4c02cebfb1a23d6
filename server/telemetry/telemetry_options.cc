// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry_options.h"

namespace tissueform {

void AddTelemetryOptions(CLI::App& app, TelemetryOptions* options) {
  app.add_option(
         "--metrics-port", options->metrics_port,
         "port of 127.0.0.1 on which Prometheus finds /metrics; 0 takes a free one (default: "
         "there is none)")
      ->check(CLI::Range(0, 65535));
  app.add_option("--log-format", options->log_format,
                 "how lines of the log look: for people, or one JSON object each")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

}  // namespace tissueform
