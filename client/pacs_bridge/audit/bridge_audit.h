// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/audit/audit_message.h"
#include "server/platform/audit/audit_log.h"

namespace tissueform {

// The audit of one process of the bridge. It records its own start and end. Thread-safe.
class BridgeAudit {
 public:
  // Errors: those of AuditLog::Reserve.
  static absl::StatusOr<std::unique_ptr<BridgeAudit>> Start(std::unique_ptr<AuditSink> sink,
                                                            const std::string& own_ae_title);
  ~BridgeAudit();
  BridgeAudit(const BridgeAudit&) = delete;
  BridgeAudit& operator=(const BridgeAudit&) = delete;

  // Before what has to be audited: places for its events. Errors: those of AuditLog::Reserve.
  absl::Status Reserve(int events) { return log_->Reserve(events); }
  void Release(int events) { log_->Release(events); }
  // An event in a place that was reserved; time and source are filled in.
  void Write(AuditEvent event);
  // An event without a place: it is lost where there is no room.
  void WriteIfRoom(AuditEvent event);

  // The bridge as a participant.
  AuditParticipant Self(AuditParticipant::Role role, bool is_requestor) const;

  // Blocks until the sink has taken everything. False when it takes nothing.
  bool Flush() { return log_->Flush(); }

 private:
  BridgeAudit(std::unique_ptr<AuditSink> sink, std::string own_ae_title);

  std::string MessageOf(AuditEvent event) const;
  AuditEvent OfApplication(AuditEvent::Kind kind) const;

  const std::string ae_title_;
  const std::unique_ptr<AuditLog> log_;
};

}  // namespace tissueform
