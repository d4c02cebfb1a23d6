// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "server/calls/call_observer.h"
#include "server/monitoring/metrics_page.h"
#include "server/telemetry/call_metrics.h"
#include "server/telemetry/server_metrics.h"
#include "server/telemetry/telemetry_options.h"

namespace tissueform {

// What a server tells of its calls. Thread-safe.
class Telemetry {
 public:
  static absl::StatusOr<std::unique_ptr<Telemetry>> Start(const TelemetryOptions& options);

  // Is to be told of every call.
  CallObserver* observer() { return &call_metrics_; }
  SessionEventCounts& session_events() { return session_events_; }
  const SessionEventCounts& session_events() const { return session_events_; }

  // The page must end before this.
  void AddTo(MetricsPage* page) const { call_metrics_.AddTo(page); }

 private:
  Telemetry() = default;

  CallMetrics call_metrics_;
  SessionEventCounts session_events_;
};

}  // namespace tissueform
