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
  CLI::Option* audit_log =
      app.add_option(
             "--audit-log", options->audit_log,
             "file to which it is written who has called what, one JSON object a line; when "
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
               "tell the system's log now and then where the audit log is, so that nobody cuts off "
               "its end unseen")
      ->needs(audit_log);
}

}  // namespace tissueform
