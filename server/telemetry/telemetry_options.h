// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"

#include "server/platform/audit/audit_options.h"

namespace tissueform {

// What a server reports to its operator, and where.
struct TelemetryOptions {
  int metrics_port = -1;  // of loopback; 0: any free one; -1: no metrics
  std::string log_format = "text";
  AuditOptions audit = {};
};

// Adds --metrics-port, --log-format and those of the audit; see AddServerOptions.
void AddTelemetryOptions(CLI::App& app, TelemetryOptions* options);

}  // namespace tissueform
