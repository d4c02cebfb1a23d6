// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/platform/audit/audit_options.h"

namespace tissueform {
namespace {

const AuditProgram kProgram = {.name = "tissueform-server", .message_id = "tissueform-call"};

}  // namespace

absl::StatusOr<std::unique_ptr<Telemetry>> Telemetry::Start(const TelemetryOptions& options,
                                                            const TlsFiles& identity,
                                                            const std::string& data_folder) {
  std::unique_ptr<Telemetry> telemetry(new Telemetry);
  if (!options.audit.enabled()) return telemetry;
  TF_ASSIGN_OR_RETURN(std::unique_ptr<AuditSink> sink,
                      OpenAuditSink(options.audit, kProgram, identity, data_folder));
  telemetry->audit_log_ = std::make_unique<AuditLog>(
      std::move(sink), AuditLog::Options{.lost_message = &AuditObserver::LostEvent});
  telemetry->audit_observer_.emplace(telemetry->audit_log_.get());
  return telemetry;
}

absl::Status Telemetry::OnBegin(const ObservedCall& call) {
  if (audit_observer_.has_value()) TF_RETURN_IF_ERROR(audit_observer_->OnBegin(call));
  return call_metrics_.OnBegin(call);
}

void Telemetry::OnResource(const ObservedCall& call) {
  if (audit_observer_.has_value()) audit_observer_->OnResource(call);
}

void Telemetry::OnEnd(const ObservedCall& call, const absl::Status& outcome,
                      std::chrono::steady_clock::duration elapsed) {
  call_metrics_.OnEnd(call, outcome, elapsed);
  if (audit_observer_.has_value()) audit_observer_->OnEnd(call, outcome, elapsed);
}

void Telemetry::AddTo(MetricsPage* page) const {
  call_metrics_.AddTo(page);
  if (audit_log_ == nullptr) return;
  const AuditLog* log = audit_log_.get();
  page->AddCounter("tissueform_audit_events_total", "Events that the journal or the buffer took.",
                   {}, [log] { return static_cast<double>(log->Read().written); });
  page->AddCounter("tissueform_audit_lost_total", "Events for which the audit log had no room.", {},
                   [log] { return static_cast<double>(log->Read().lost); });
  page->AddGauge("tissueform_audit_waiting", "Events that wait to be written.", {},
                 [log] { return static_cast<double>(log->Read().waiting); });
  page->AddGauge("tissueform_audit_failing",
                 "1 while the audit log cannot be written, and work is refused.", {},
                 [log] { return log->Read().failing ? 1.0 : 0.0; });
  page->AddGauge("tissueform_audit_buffer_use_ratio",
                 "Part of the buffer that holds events which the collector does not have.", {},
                 [log] { return log->BufferUse(); });
}

}  // namespace tissueform
