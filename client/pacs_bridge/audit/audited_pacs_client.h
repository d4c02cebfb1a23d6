// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "client/pacs_bridge/audit/bridge_audit.h"
#include "client/pacs_bridge/network/pacs_client.h"

namespace tissueform {

// Audits what a PACS is asked, gives and is sent. The objects of FetchSeries are audited by the
// sink that takes them (AuditedSink); a fetch that fails is audited here.
//
// Errors of all calls: also Unavailable with AUDIT_NOT_WRITTEN: the audit takes no events, and
// nothing was done. A refusal by the PACS, or of its certificate, is also a security alert.
//
// `audit` must outlive it. Threads: as PacsClient.
std::unique_ptr<PacsClient> MakeAuditedPacsClient(BridgeAudit* audit, const PacsPeer& peer,
                                                  std::unique_ptr<PacsClient> client);

}  // namespace tissueform
