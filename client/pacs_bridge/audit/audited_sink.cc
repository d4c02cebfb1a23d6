// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audited_sink.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// One begins, one ends for what was kept, one for what was not.
constexpr int kEventsOfTransfer = 3;

}  // namespace

absl::Status AuditedSink::Keep(const ReceivedInstance& instance) {
  TF_RETURN_IF_ERROR(Begin(instance));
  absl::Status status = sink_->Keep(instance);
  const StudyKey key(instance.header.study_uid, instance.header.patient_id);
  MutexLock lock(mutex_);
  Transfer& transfer = transfers_[instance.association][key];
  AuditedStudy& study = status.ok() ? transfer.kept : transfer.refused;
  ++study.objects_of_class[instance.header.class_uid];
  return status;
}

absl::Status AuditedSink::Begin(const ReceivedInstance& instance) {
  const AuditedStudy study = {.study_uid = instance.header.study_uid,
                              .patient_id = instance.header.patient_id};
  {
    MutexLock lock(mutex_);
    auto& transfers = transfers_[instance.association];
    if (transfers.contains({study.study_uid, study.patient_id})) return absl::OkStatus();
    if (const absl::Status reserved = audit_->Reserve(kEventsOfTransfer); !reserved.ok()) {
      return absl::ResourceExhaustedError(reserved.message());
    }
    transfers[{study.study_uid, study.patient_id}] = {.kept = study, .refused = study};
  }
  audit_->Write(
      EventOf(AuditEvent::Kind::kTransferBegin, study, instance.calling_ae, instance.address));
  return absl::OkStatus();
}

void AuditedSink::AssociationEnded(const EndedAssociation& ended) {
  std::map<StudyKey, Transfer> transfers;
  {
    MutexLock lock(mutex_);
    const auto found = transfers_.find(ended.association);
    if (found != transfers_.end()) {
      transfers = std::move(found->second);
      transfers_.erase(found);
    }
  }
  for (const auto& [key, transfer] : transfers) {
    for (const AuditedStudy* const study : {&transfer.kept, &transfer.refused}) {
      if (study->objects_of_class.empty()) {
        audit_->Release(1);
        continue;
      }
      AuditEvent event =
          EventOf(AuditEvent::Kind::kTransferred, *study, ended.calling_ae, ended.address);
      if (study == &transfer.refused) event.outcome = absl::UnknownError("refused by the bridge");
      audit_->Write(std::move(event));
    }
  }
  sink_->AssociationEnded(ended);
}

AuditEvent AuditedSink::EventOf(AuditEvent::Kind kind, const AuditedStudy& study,
                                const std::string& ae_title, const std::string& address) const {
  return {.kind = kind,
          .participants = {{.role = AuditParticipant::Role::kSource,
                            .user_id = ae_title,
                            .ae_title = ae_title,
                            .host = address,
                            .is_requestor = true},
                           audit_->Self(AuditParticipant::Role::kDestination, false)},
          .study = study};
}

void AuditedSink::ConnectionRefused(const RefusedConnection& refused) {
  access_->ConnectionRefused(refused);
  sink_->ConnectionRefused(refused);
}

}  // namespace tissueform
