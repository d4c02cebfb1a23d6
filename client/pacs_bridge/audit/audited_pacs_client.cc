// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audited_pacs_client.h"

#include <array>
#include <map>
#include <utility>

#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/dicom/instance_header.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Role = AuditParticipant::Role;

struct QueryKeys {
  const char* level;
  std::string study_uid = {};
  std::string accession_number = {};
  std::string series_uid = {};
  std::string instance_uid = {};
};

// The identifier as a C-FIND sends it; DICOMweb asks by the same keys.
std::string EncodedQuery(const QueryKeys& keys) {
  DcmDataset identifier;
  identifier.putAndInsertString(DCM_QueryRetrieveLevel, keys.level);
  const std::array<std::pair<DcmTagKey, const std::string*>, 4> values = {{
      {DCM_AccessionNumber, &keys.accession_number},
      {DCM_StudyInstanceUID, &keys.study_uid},
      {DCM_SeriesInstanceUID, &keys.series_uid},
      {DCM_SOPInstanceUID, &keys.instance_uid},
  }};
  for (const auto& [tag, value] : values) {
    if (!value->empty()) identifier.putAndInsertString(DcmTag(tag), value->c_str());
  }
  std::array<char, 2048> bytes = {};
  DcmOutputBufferStream stream(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  identifier.transferInit();
  identifier.write(stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr);
  identifier.transferEnd();
  void* begin = nullptr;
  offile_off_t size = 0;
  stream.flushBuffer(begin, size);
  return {static_cast<const char*>(begin), static_cast<size_t>(size)};
}

class AuditedPacsClient final : public PacsClient {
 public:
  AuditedPacsClient(BridgeAudit* audit, const PacsPeer& peer, std::unique_ptr<PacsClient> client)
      : audit_(audit),
        peer_({.user_id = peer.url.empty() ? peer.ae_title : peer.url,
               .ae_title = peer.url.empty() ? peer.ae_title : "",
               .host = peer.url.empty() ? peer.host : peer.url}),
        client_(std::move(client)) {}

  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery& query) override {
    return Query({.level = "SERIES",
                  .study_uid = query.study_uid,
                  .accession_number = query.accession_number},
                 [&] { return client_->FindSeries(query); });
  }

  absl::StatusOr<PatientSummary> FindPatient(const std::string& study_uid) override {
    return Query({.level = "STUDY", .study_uid = study_uid},
                 [&] { return client_->FindPatient(study_uid); });
  }

  absl::StatusOr<bool> Has(const std::string& study_uid, const std::string& series_uid,
                           const std::string& instance_uid) override {
    return Query({.level = "IMAGE",
                  .study_uid = study_uid,
                  .series_uid = series_uid,
                  .instance_uid = instance_uid},
                 [&] { return client_->Has(study_uid, series_uid, instance_uid); });
  }

  absl::StatusOr<FetchCounts> FetchSeries(const std::string& study_uid,
                                          const std::string& series_uid, InstanceFolder* folder,
                                          InstanceSink* sink) override {
    TF_RETURN_IF_ERROR(audit_->Reserve(2));
    auto counts = client_->FetchSeries(study_uid, series_uid, folder, sink);
    if (counts.ok()) {
      audit_->Release(1);
    } else {
      WriteTransferred({.study_uid = study_uid}, counts.status(), /*to_pacs=*/false);
    }
    WriteRefusal(counts.status());
    return counts;
  }

  absl::Status FetchHeader(const std::string& study_uid, const std::string& series_uid,
                           const std::string& path) override {
    TF_RETURN_IF_ERROR(audit_->Reserve(2));
    absl::Status status = client_->FetchHeader(study_uid, series_uid, path);
    AuditedStudy study = {.study_uid = study_uid};
    if (status.ok()) {
      const absl::StatusOr<InstanceHeader> header = ReadInstanceHeader(path);
      if (header.ok()) {
        study.patient_id = header->patient_id;
        study.objects_of_class[header->class_uid] = 1;
      }
    }
    WriteTransferred(study, status, /*to_pacs=*/false);
    WriteRefusal(status);
    return status;
  }

  absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) override {
    std::map<StudyKey, AuditedStudy> begun;
    std::vector<InstanceHeader> headers;
    for (const std::string& path : paths) {
      TF_ASSIGN_OR_RETURN(headers.emplace_back(), ReadInstanceHeader(path));
      Count(headers.back(), &begun);
    }
    // Each begins, and ends for what was stored and for what was not; and one refusal.
    const int events = 3 * static_cast<int>(begun.size()) + 1;
    TF_RETURN_IF_ERROR(audit_->Reserve(events));
    for (const auto& [key, study] : begun) {
      audit_->Write({.kind = AuditEvent::Kind::kTransferBegin,
                     .participants = Participants(/*to_pacs=*/true),
                     .study = study});
    }
    auto stored = client_->Store(paths);
    const int written = WriteStored(headers, begun, stored);
    audit_->Release(2 * static_cast<int>(begun.size()) - written);
    WriteRefusal(stored.status());
    return stored;
  }

 private:
  using StudyKey = std::pair<std::string, std::string>;  // study and patient

  template <typename Call>
  auto Query(const QueryKeys& keys, Call call) -> decltype(call()) {
    TF_RETURN_IF_ERROR(audit_->Reserve(2));
    auto result = call();
    AuditParticipant pacs = peer_;
    pacs.role = Role::kDestination;
    audit_->Write({.kind = AuditEvent::Kind::kQuery,
                   .outcome = result.status(),
                   .participants = {audit_->Self(Role::kSource, true), pacs},
                   .query = EncodedQuery(keys)});
    WriteRefusal(result.status());
    return result;
  }

  static void Count(const InstanceHeader& header, std::map<StudyKey, AuditedStudy>* studies) {
    AuditedStudy& study = (*studies)[{header.study_uid, header.patient_id}];
    study.study_uid = header.study_uid;
    study.patient_id = header.patient_id;
    ++study.objects_of_class[header.class_uid];
  }

  // We ask for what is fetched, and for what is stored.
  std::vector<AuditParticipant> Participants(bool to_pacs) const {
    AuditParticipant pacs = peer_;
    pacs.role = to_pacs ? Role::kDestination : Role::kSource;
    return {audit_->Self(to_pacs ? Role::kSource : Role::kDestination, true), pacs};
  }

  void WriteTransferred(const AuditedStudy& study, const absl::Status& outcome, bool to_pacs) {
    audit_->Write({.kind = AuditEvent::Kind::kTransferred,
                   .outcome = outcome,
                   .participants = Participants(to_pacs),
                   .study = study});
  }

  // Returns how many events it has written.
  int WriteStored(const std::vector<InstanceHeader>& headers,
                  const std::map<StudyKey, AuditedStudy>& begun,
                  const absl::StatusOr<std::vector<StoredObject>>& stored) {
    std::map<StudyKey, AuditedStudy> kept;
    std::map<StudyKey, AuditedStudy> refused;
    absl::Status reason = stored.status();
    if (!stored.ok()) refused = begun;
    for (size_t i = 0; stored.ok() && i < headers.size(); ++i) {
      const bool is_kept = i < stored->size() && (*stored)[i].status.ok();
      if (i < stored->size()) reason.Update((*stored)[i].status);
      Count(headers[i], is_kept ? &kept : &refused);
    }
    if (reason.ok()) reason = absl::UnknownError("the PACS did not answer for all objects");
    for (const auto& [key, study] : kept) WriteTransferred(study, {}, /*to_pacs=*/true);
    for (const auto& [key, study] : refused) WriteTransferred(study, reason, /*to_pacs=*/true);
    return static_cast<int>(kept.size() + refused.size());
  }

  // In the last place of a call.
  void WriteRefusal(const absl::Status& status) {
    if (!absl::IsPermissionDenied(status) && !absl::IsUnauthenticated(status)) {
      return audit_->Release(1);
    }
    audit_->Write({.kind = AuditEvent::Kind::kNodeRefused,
                   .outcome = status,
                   .participants = {audit_->Self(Role::kNone, true), peer_}});
  }

  BridgeAudit* const audit_;
  const AuditParticipant peer_;
  const std::unique_ptr<PacsClient> client_;
};

}  // namespace

std::unique_ptr<PacsClient> MakeAuditedPacsClient(BridgeAudit* audit, const PacsPeer& peer,
                                                  std::unique_ptr<PacsClient> client) {
  return std::make_unique<AuditedPacsClient>(audit, peer, std::move(client));
}

}  // namespace tissueform
