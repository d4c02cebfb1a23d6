// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry_options.h"

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
  CLI::Option* audit_log =
      app.add_option("--audit-log", options->audit_log,
                     "audit log: who called what, one JSON object per line; when "
                     "it cannot be written, calls are refused")
          ->type_name("FILE");
  CLI::Option* audit_key =
      app.add_option("--audit-key", options->audit_key,
                     "file with the key of the audit log's chain, mode 0600 (`tissueform audit "
                     "keygen` makes one)")
          ->type_name("FILE");
  audit_log->needs(audit_key);
  audit_key->needs(audit_log);
  app.add_flag("--audit-syslog", options->audit_syslog,
               "write checkpoints of the audit log to the system log, so that "
               "truncation is detected")
      ->needs(audit_log);
}

}  // namespace tissueform
