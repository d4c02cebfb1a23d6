// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/bridge_parts.h"

#include <cstdint>
#include <unistd.h>
#include <utility>

#include "spdlog/spdlog.h"
#include <sys/eventfd.h>

#include "client/pacs_bridge/audit/audited_pacs_client.h"
#include "client/pacs_bridge/work/prediction_writer.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

PacsPeer PeerOf(const BridgeOptions& options) {
  PacsPeer peer = options.pacs;
  peer.kind = peer.url.empty() ? PacsPeer::Kind::kDimse : PacsPeer::Kind::kDicomWeb;
  peer.name = peer.url.empty() ? peer.ae_title : "DICOMweb";
  peer.own_ae_title = options.receiver.ae_title;
  const bool web_with_files = !peer.url.empty() && !options.tls.authorities.empty();
  if (peer.tls.has_value() || web_with_files) peer.tls = options.tls;
  return peer;
}

}  // namespace

ReceiverOptions ReceiverOptionsOf(const BridgeOptions& options) {
  ReceiverOptions receiver = options.receiver;
  if (!options.tls.certificate.empty()) receiver.tls = options.tls;
  return receiver;
}

absl::Status BridgeParts::StartAudit(const BridgeOptions& options, const std::string& folder) {
  if (!options.audit.enabled()) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(
      std::unique_ptr<AuditSink> sink,
      OpenAuditSink(options.audit, {.name = "tissueform-pacs", .message_id = kDicomAuditMessageId},
                    options.tls, folder));
  TF_ASSIGN_OR_RETURN(audit_, BridgeAudit::Start(std::move(sink), options.receiver.ae_title));
  access_audit_ = std::make_unique<AccessAudit>(audit_.get(), AccessAudit::Options{});
  return absl::OkStatus();
}

absl::Status BridgeParts::OpenPacs(const BridgeOptions& options) {
  if (!options.has_pacs()) return absl::OkStatus();
  const PacsPeer peer = PeerOf(options);
  TF_ASSIGN_OR_RETURN(pacs_, MakePacsClient(peer));
  TF_ASSIGN_OR_RETURN(counting_pacs_, MakePacsClient(peer));
  if (audit_ == nullptr) return absl::OkStatus();
  pacs_ = MakeAuditedPacsClient(audit_.get(), peer, std::move(pacs_));
  counting_pacs_ = MakeAuditedPacsClient(audit_.get(), peer, std::move(counting_pacs_));
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<BridgeParts>> BridgeParts::Open(const BridgeOptions& options) {
  std::unique_ptr<BridgeParts> parts(new BridgeParts());
  TF_ASSIGN_OR_RETURN(const std::string folder, StateFolderOf(options));
  TF_ASSIGN_OR_RETURN(parts->queue_, BridgeQueue::Open(folder));
  TF_ASSIGN_OR_RETURN(parts->folder_,
                      InstanceFolder::Open({.path = parts->queue_->received_folder(),
                                            .watermark_bytes = options.watermark_bytes}));
  TF_RETURN_IF_ERROR(parts->StartAudit(options, folder));
  if (!options.server.empty()) {
    TF_ASSIGN_OR_RETURN(parts->server_,
                        ConnectToCaseServer(options.server, options.connection, options.project));
  }
  TF_RETURN_IF_ERROR(parts->OpenPacs(options));
  SeriesIntakeOptions intake;
  intake.quiet = options.quiet;
  if (!options.rules.empty() || !options.recipe.empty()) {
    TF_ASSIGN_OR_RETURN(intake.rules, RulesOf(options));
  }
  if (PacsClient* const pacs = parts->counting_pacs_.get()) {
    intake.find_series = [pacs](const std::string& study) {
      return pacs->FindSeries({.study_uid = study});
    };
  }
  parts->intake_ = std::make_unique<SeriesIntake>(parts->queue_.get(), std::move(intake));
  parts->intake_sink_ = std::make_unique<IntakeSink>(parts->intake_.get());
  if (parts->audit_ != nullptr) {
    parts->audited_sink_ = std::make_unique<AuditedSink>(
        parts->audit_.get(), parts->access_audit_.get(), parts->intake_sink_.get());
  }
  parts->cancel_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  parts->writer_ = MakePredictionWriter(options.receiver.ae_title, parts->cancel_);
  parts->export_options_ = {.header_lifetime = options.retention.keep_headers,
                            .warn = [](const std::string& line) { spdlog::warn("{}", line); },
                            .inform = [](const std::string& line) { spdlog::info("{}", line); }};
  TF_RETURN_IF_ERROR(parts->intake_->Recover());
  return parts;
}

BridgeParts::~BridgeParts() {
  if (cancel_ >= 0) close(cancel_);
}

void BridgeParts::Cancel() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(cancel_, &one, sizeof(one));
}

std::unique_ptr<ExportWork> BridgeParts::MakeExportWork() {
  if (server_ == nullptr || pacs_ == nullptr) return nullptr;
  return std::make_unique<ExportWork>(queue_.get(), server_.get(), pacs_.get(), writer_.get(),
                                      export_options_);
}

}  // namespace tissueform
