// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/bridge_audit.h"

#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

#include "core/base/status_macros.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<BridgeAudit>> BridgeAudit::Start(std::unique_ptr<AuditSink> sink,
                                                                const std::string& own_ae_title) {
  std::unique_ptr<BridgeAudit> audit(new BridgeAudit(std::move(sink), own_ae_title));
  TF_RETURN_IF_ERROR(audit->Reserve(2));  // the second is the destructor's
  audit->Write(audit->OfApplication(AuditEvent::Kind::kApplicationStart));
  return audit;
}

BridgeAudit::BridgeAudit(std::unique_ptr<AuditSink> sink, std::string own_ae_title)
    : ae_title_(std::move(own_ae_title)),
      log_(std::make_unique<AuditLog>(std::move(sink), AuditLog::Options{})) {}

BridgeAudit::~BridgeAudit() { Write(OfApplication(AuditEvent::Kind::kApplicationStop)); }

std::string BridgeAudit::MessageOf(AuditEvent event) const {
  event.time = absl::Now();
  event.source = ae_title_;
  return ToAuditMessage(event);
}

void BridgeAudit::Write(AuditEvent event) { log_->Write(MessageOf(std::move(event))); }

void BridgeAudit::WriteIfRoom(AuditEvent event) { log_->WriteIfRoom(MessageOf(std::move(event))); }

AuditParticipant BridgeAudit::Self(AuditParticipant::Role role, bool is_requestor) const {
  return {.role = role,
          .user_id = absl::StrCat(getpid()),
          .ae_title = ae_title_,
          .is_requestor = is_requestor};
}

AuditEvent BridgeAudit::OfApplication(AuditEvent::Kind kind) const {
  return {.kind = kind,
          .participants = {Self(AuditParticipant::Role::kApplication, /*is_requestor=*/false)}};
}

}  // namespace tissueform
