// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/status/status.h"

#include "client/pacs_bridge/audit/access_audit.h"
#include "client/pacs_bridge/audit/bridge_audit.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "core/base/mutex.h"

namespace tissueform {

// Audits what is received, and passes it on: for each study in an association an event when it
// begins, and when it ends one for the objects that were kept and one for those that were not.
// Refused connections go to `access`.
// Thread-safe.
class AuditedSink final : public InstanceSink {
 public:
  // All must outlive it.
  AuditedSink(BridgeAudit* audit, AccessAudit* access, InstanceSink* sink)
      : audit_(audit), access_(access), sink_(sink) {}

  // Errors: also ResourceExhausted: the audit takes no events.
  absl::Status Keep(const ReceivedInstance& instance) override;
  void AssociationEnded(const EndedAssociation& ended) override;
  void ConnectionRefused(const RefusedConnection& refused) override;

 private:
  struct Transfer {
    AuditedStudy kept;
    AuditedStudy refused;
  };
  using StudyKey = std::pair<std::string, std::string>;  // study and patient

  absl::Status Begin(const ReceivedInstance& instance) ABSL_LOCKS_EXCLUDED(mutex_);
  AuditEvent EventOf(AuditEvent::Kind kind, const AuditedStudy& study, const std::string& ae_title,
                     const std::string& address) const;

  BridgeAudit* const audit_;
  AccessAudit* const access_;
  InstanceSink* const sink_;

  Mutex mutex_;
  // Of associations that are open.
  std::map<int64_t, std::map<StudyKey, Transfer>> transfers_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
