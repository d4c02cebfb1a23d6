// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/audit/access_audit.h"
#include "client/pacs_bridge/audit/audited_sink.h"
#include "client/pacs_bridge/audit/bridge_audit.h"
#include "client/pacs_bridge/bridge_options.h"
#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/work/export_work.h"
#include "client/pacs_bridge/work/intake_sink.h"
#include "client/pacs_bridge/work/series_intake.h"

namespace tissueform {

// What the commands of a bridge work with, joined by its options in one place.
class BridgeParts {
 public:
  // Opens the queue, and recovers images that were received before a crash. Sends no requests yet.
  //
  // Errors: those of BridgeQueue::Open, InstanceFolder::Open, RulesOf (a file of rules; none is
  // needed for receiving), ConnectToCaseServer, MakePacsClient and OpenAuditSink.
  static absl::StatusOr<std::unique_ptr<BridgeParts>> Open(const BridgeOptions& options);

  BridgeQueue& queue() { return *queue_; }
  SeriesIntake& intake() { return *intake_; }
  InstanceFolder& folder() { return *folder_; }
  InstanceSink& sink() {
    if (audited_sink_ != nullptr) return *audited_sink_;
    return *intake_sink_;
  }
  // Null: no audit.
  AccessAudit* access_audit() { return access_audit_.get(); }
  // Null: --server, or the PACS, is not given.
  CaseServer* server() { return server_.get(); }
  PacsClient* pacs() { return pacs_.get(); }

  // Becomes readable by Cancel: what PlanWork and the drawing of pictures end by.
  int cancel() const { return cancel_; }
  void Cancel();

  // Null where there is no server, or no PACS.
  std::unique_ptr<ExportWork> MakeExportWork();

  ~BridgeParts();
  BridgeParts(const BridgeParts&) = delete;
  BridgeParts& operator=(const BridgeParts&) = delete;

 private:
  BridgeParts() = default;
  absl::Status StartAudit(const BridgeOptions& options, const std::string& folder);
  absl::Status OpenPacs(const BridgeOptions& options);

  std::unique_ptr<BridgeAudit> audit_;  // null: none; the others use it
  std::unique_ptr<AccessAudit> access_audit_;
  std::unique_ptr<BridgeQueue> queue_;
  std::unique_ptr<InstanceFolder> folder_;
  std::unique_ptr<CaseServer> server_;
  std::unique_ptr<PacsClient> pacs_;
  std::unique_ptr<PacsClient> counting_pacs_;  // of the intake's thread
  std::unique_ptr<ObjectWriter> writer_;
  std::unique_ptr<SeriesIntake> intake_;
  std::unique_ptr<IntakeSink> intake_sink_;
  std::unique_ptr<AuditedSink> audited_sink_;  // null: no audit
  ExportWorkOptions export_options_ = {};
  int cancel_ = -1;
};

// The options of the receiver, with TLS where that is set.
ReceiverOptions ReceiverOptionsOf(const BridgeOptions& options);

}  // namespace tissueform
