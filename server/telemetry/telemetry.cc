// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry.h"

#include <string>
#include <syslog.h>
#include <utility>

#include "core/base/status_macros.h"
#include "server/platform/audit_chain/audit_key.h"

namespace tissueform {
namespace {

void TellSystemLog(const std::string& text) {
  syslog(LOG_AUTHPRIV | LOG_NOTICE, "%s", text.c_str());
}

}  // namespace

absl::StatusOr<std::unique_ptr<Telemetry>> Telemetry::Start(const TelemetryOptions& options) {
  std::unique_ptr<Telemetry> telemetry(new Telemetry);
  if (!options.audit_log.empty()) TF_RETURN_IF_ERROR(telemetry->StartAudit(options));
  return telemetry;
}

absl::Status Telemetry::StartAudit(const TelemetryOptions& options) {
  TF_ASSIGN_OR_RETURN(AuditKey key, AuditKey::Read(options.audit_key));
  AuditLog::Options log_options;
  log_options.file = {.path = options.audit_log};
  if (options.audit_syslog) log_options.checkpoint = TellSystemLog;
  TF_ASSIGN_OR_RETURN(audit_log_, AuditLog::Open(std::move(key), std::move(log_options)));
  audit_observer_.emplace(audit_log_.get());
  return absl::OkStatus();
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

void Telemetry::CheckFiles() {
  if (audit_log_ != nullptr) audit_log_->CheckFile();
}

void Telemetry::AddTo(MetricsPage* page) const {
  call_metrics_.AddTo(page);
  if (audit_log_ == nullptr) return;
  const AuditLog* log = audit_log_.get();
  page->AddCounter("tissueform_audit_lines_total", "Lines written to the audit log.", {},
                   [log] { return static_cast<double>(log->Read().written); });
  page->AddCounter("tissueform_audit_lost_total", "Lines for which the audit log had no room.", {},
                   [log] { return static_cast<double>(log->Read().lost); });
  page->AddGauge("tissueform_audit_waiting", "Lines that wait to be written.", {},
                 [log] { return static_cast<double>(log->Read().waiting); });
  page->AddGauge("tissueform_audit_failing",
                 "1 while the audit log cannot be written, and work is refused.", {},
                 [log] { return log->Read().failing ? 1.0 : 0.0; });
}

}  // namespace tissueform
