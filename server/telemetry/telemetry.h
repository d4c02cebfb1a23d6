// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/certificates.h"
#include "server/platform/audit/audit_log.h"
#include "server/platform/metrics_page.h"
#include "server/rpc/calls/call_observer.h"
#include "server/telemetry/audit_observer.h"
#include "server/telemetry/call_metrics.h"
#include "server/telemetry/server_metrics.h"
#include "server/telemetry/telemetry_options.h"

namespace tissueform {

// What a server reports of its calls: metrics always, an audit where the options ask for one. It
// must observe every call. Thread-safe.
class Telemetry final : public CallObserver {
 public:
  // `identity` and `data_folder` as in OpenAuditSink. Errors: those of OpenAuditSink.
  static absl::StatusOr<std::unique_ptr<Telemetry>> Start(const TelemetryOptions& options,
                                                          const TlsFiles& identity = {},
                                                          const std::string& data_folder = {});

  // The audit decides: errors are its own.
  absl::Status OnBegin(const ObservedCall& call) override;
  void OnResource(const ObservedCall& call) override;
  void OnEnd(const ObservedCall& call, const absl::Status& outcome,
             std::chrono::steady_clock::duration elapsed) override;

  SessionEventCounts& session_events() { return session_events_; }
  const SessionEventCounts& session_events() const { return session_events_; }

  // The page must end before this.
  void AddTo(MetricsPage* page) const;

 private:
  Telemetry() = default;

  CallMetrics call_metrics_;
  SessionEventCounts session_events_;
  std::unique_ptr<AuditLog> audit_log_;  // null: no audit
  std::optional<AuditObserver> audit_observer_;
};

}  // namespace tissueform
