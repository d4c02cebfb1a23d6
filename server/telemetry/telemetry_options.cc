// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry_options.h"

#include "server/platform/program_options.h"

namespace tissueform {

void AddTelemetryOptions(CLI::App& app, TelemetryOptions* options) {
  app.add_option("--metrics-port", options->metrics_port,
                 "port of 127.0.0.1 for Prometheus' /metrics; 0 takes a free one (default: "
                 "none)")
      ->check(CLI::Range(0, 65535));
  app.add_option("--log-format", options->log_format,
                 "log format: text, or one JSON object per line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  AddAuditOptions(app, "the data folder", &options->audit);
  for (const char* const name : {"--audit-log", "--audit-key", "--audit-syslog"}) {
    AddRemovedOption(app, name, "give --audit journal or --audit syslog://HOST:PORT");
  }
}

}  // namespace tissueform
