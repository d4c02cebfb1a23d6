// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dimse_client.h"

#include <optional>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dimse.h>

#include "client/pacs_bridge/dicom/dicom_text.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/dimse_association.h"
#include "client/pacs_bridge/network/dimse_queries.h"
#include "client/pacs_bridge/network/one_header.h"
#include "core/base/status_macros.h"
#include "core/imaging/series/image_header.h"

namespace tissueform {
namespace {

constexpr size_t kMaxContexts = 128;
constexpr DIC_US kWarningClass = 0xB000;

int Whole(const std::string& text) {
  int number = 0;
  return absl::SimpleAtoi(text, &number) ? number : 0;
}

SeriesSummary SummaryOf(DcmDataset* answer) {
  DicomTexts texts(answer);
  SeriesSummary summary;
  summary.study_uid = texts.Get(DCM_StudyInstanceUID);
  summary.series_uid = texts.Get(DCM_SeriesInstanceUID);
  summary.modality = texts.Get(DCM_Modality);
  summary.description = texts.Get(DCM_SeriesDescription);
  summary.study_date = texts.Get(DCM_StudyDate);
  summary.patient_id = texts.Get(DCM_PatientID);
  summary.number = Whole(texts.Get(DCM_SeriesNumber));
  summary.instances = Whole(texts.Get(DCM_NumberOfSeriesRelatedInstances));
  return summary;
}

PatientSummary PatientOf(DcmDataset* answer) {
  DicomTexts texts(answer);
  PatientSummary patient;
  patient.name = texts.Get(DCM_PatientName);
  patient.id = texts.Get(DCM_PatientID);
  patient.issuer = texts.Get(DCM_IssuerOfPatientID);
  patient.birth_date = texts.Get(DCM_PatientBirthDate);
  patient.readable = texts.problem().empty();
  return patient;
}

// What is to be sent, as its file says.
struct OutgoingObject {
  std::string path;
  std::string class_uid;
  std::string instance_uid;
  std::string transfer_syntax_uid;
};

absl::StatusOr<OutgoingObject> ReadOutgoing(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const InstanceHeader header, ReadInstanceHeader(path));
  return OutgoingObject{path, header.class_uid, header.instance_uid, header.transfer_syntax_uid};
}

std::vector<ProposedContext> StoreContexts(const std::vector<OutgoingObject>& objects) {
  std::set<std::pair<std::string, std::string>> kinds;
  for (const OutgoingObject& object : objects) {
    kinds.insert({object.class_uid, object.transfer_syntax_uid});
  }
  std::vector<ProposedContext> contexts;
  contexts.reserve(kinds.size());
  for (const auto& [kind, syntax] : kinds) contexts.push_back({kind, {syntax}});
  return contexts;
}

class DimseClient : public PacsClient {
 public:
  DimseClient(PacsPeer peer, std::shared_ptr<DcmTransportLayer> secure)
      : peer_(std::move(peer)),
        secure_(std::move(secure)),
        seconds_(static_cast<int>(peer_.answer_time.count())) {}

  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery& query) override {
    TF_ASSIGN_OR_RETURN(const auto association, Associate(FindContexts()));
    std::vector<std::string> studies;
    if (query.study_uid.empty()) {
      TF_RETURN_IF_ERROR(FindStudies(association.get(), query.accession_number, &studies));
    } else {
      studies.push_back(query.study_uid);
    }
    std::vector<SeriesSummary> series;
    for (const std::string& study : studies) {
      if (!IsDicomUid(study)) return absl::InvalidArgumentError("a study's UID is no UID");
      StudyRootQuery wanted = {"SERIES",
                               {{DCM_StudyInstanceUID, study},
                                {DCM_SeriesInstanceUID, ""},
                                {DCM_Modality, ""},
                                {DCM_SeriesDescription, ""},
                                {DCM_SeriesNumber, ""},
                                {DCM_StudyDate, ""},
                                {DCM_PatientID, ""},
                                {DCM_NumberOfSeriesRelatedInstances, ""}}};
      TF_RETURN_IF_ERROR(Find(association.get(), wanted, [&](DcmDataset* answer) {
        series.push_back(SummaryOf(answer));
        if (series.back().study_uid.empty()) series.back().study_uid = study;
      }));
    }
    if (series.empty()) return NotThere("study");
    return series;
  }

  absl::StatusOr<PatientSummary> FindPatient(const std::string& study_uid) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid}));
    TF_ASSIGN_OR_RETURN(const auto association, Associate(FindContexts()));
    std::optional<PatientSummary> patient;
    TF_RETURN_IF_ERROR(Find(association.get(),
                            {"STUDY",
                             {{DCM_StudyInstanceUID, study_uid},
                              {DCM_PatientName, ""},
                              {DCM_PatientID, ""},
                              {DCM_IssuerOfPatientID, ""},
                              {DCM_PatientBirthDate, ""}}},
                            [&](DcmDataset* answer) {
                              const std::string uid = DicomTexts(answer).Get(DCM_StudyInstanceUID);
                              if (uid == study_uid) patient = PatientOf(answer);
                            }));
    if (!patient.has_value()) return NotThere("study");
    return *patient;
  }

  absl::StatusOr<FetchCounts> FetchSeries(const std::string& study_uid,
                                          const std::string& series_uid, InstanceFolder* folder,
                                          InstanceSink* sink) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid}));
    const StudyRootQuery wanted = {
        "SERIES", {{DCM_StudyInstanceUID, study_uid}, {DCM_SeriesInstanceUID, series_uid}}};
    if (peer_.fetch == PacsPeer::Fetch::kMove) {
      TF_ASSIGN_OR_RETURN(const auto association, Associate(MoveContexts()));
      return MoveByDimse(peer_.name, association.get(), wanted, peer_.own_ae_title, seconds_);
    }
    return Get(wanted, *folder, sink);
  }

  absl::Status FetchHeader(const std::string& study_uid, const std::string& series_uid,
                           const std::string& path) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid}));
    TF_ASSIGN_OR_RETURN(const std::string instance, SourceInstance(study_uid, series_uid));
    const StudyRootQuery wanted = {"IMAGE",
                                   {{DCM_StudyInstanceUID, study_uid},
                                    {DCM_SeriesInstanceUID, series_uid},
                                    {DCM_SOPInstanceUID, instance}}};
    return KeepOneHeader(path, [&](const InstanceFolder& folder, InstanceSink* sink) {
      return Get(wanted, folder, sink).status();
    });
  }

  absl::StatusOr<bool> Has(const std::string& study_uid, const std::string& series_uid,
                           const std::string& instance_uid) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid, instance_uid}));
    TF_ASSIGN_OR_RETURN(const auto association, Associate(FindContexts()));
    bool found = false;
    TF_RETURN_IF_ERROR(Find(association.get(),
                            {"IMAGE",
                             {{DCM_StudyInstanceUID, study_uid},
                              {DCM_SeriesInstanceUID, series_uid},
                              {DCM_SOPInstanceUID, instance_uid}}},
                            [&](DcmDataset* answer) {
                              found |= DicomTexts(answer).Get(DCM_SOPInstanceUID) == instance_uid;
                            }));
    return found;
  }

  absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) override {
    std::vector<OutgoingObject> objects;
    for (const std::string& path : paths) {
      TF_ASSIGN_OR_RETURN(objects.emplace_back(), ReadOutgoing(path));
    }
    if (objects.empty()) return std::vector<StoredObject>();
    std::vector<ProposedContext> contexts = StoreContexts(objects);
    if (contexts.size() > kMaxContexts) {
      return absl::InvalidArgumentError("more than 128 kinds of objects are sent at once");
    }
    TF_ASSIGN_OR_RETURN(const auto association, Associate(contexts));
    std::vector<StoredObject> stored;
    absl::Status broken;
    for (const OutgoingObject& object : objects) {
      if (broken.ok()) broken = StoreOne(association.get(), object, &stored);
      if (!broken.ok()) stored.push_back({object.path, object.instance_uid, broken});
    }
    return stored;
  }

 private:
  absl::StatusOr<std::unique_ptr<DimseAssociation>> Associate(
      const std::vector<ProposedContext>& contexts) {
    return DimseAssociation::Request(peer_, secure_.get(), contexts);
  }

  absl::Status Find(DimseAssociation* association, const StudyRootQuery& query,
                    const std::function<void(DcmDataset*)>& take) {
    return FindByDimse(peer_.name, association, query, seconds_, take);
  }

  absl::Status FindStudies(DimseAssociation* association, const std::string& accession_number,
                           std::vector<std::string>* studies) {
    // Wild cards would match other patients.
    if (accession_number.empty() || accession_number.size() > 16 ||
        accession_number.find_first_of("*?\\") != std::string::npos) {
      return absl::InvalidArgumentError(
          "name a study's UID, or an accession number without * or ?");
    }
    return Find(association,
                {"STUDY", {{DCM_AccessionNumber, accession_number}, {DCM_StudyInstanceUID, ""}}},
                [&](DcmDataset* answer) {
                  studies->push_back(DicomTexts(answer).Get(DCM_StudyInstanceUID));
                });
  }

  absl::StatusOr<FetchCounts> Get(const StudyRootQuery& query, const InstanceFolder& folder,
                                  InstanceSink* sink) {
    TF_ASSIGN_OR_RETURN(const auto association, Associate(GetContexts()));
    AnnouncedInstance announced;
    announced.calling_ae = peer_.ae_title;
    announced.address = peer_.host;
    return GetByDimse(peer_.name, association.get(), query, seconds_, announced, folder, sink);
  }

  // A CT image where the PACS names one, otherwise any.
  absl::StatusOr<std::string> SourceInstance(const std::string& study_uid,
                                             const std::string& series_uid) {
    TF_ASSIGN_OR_RETURN(const auto association, Associate(FindContexts()));
    std::string instance;
    bool is_ct = false;
    TF_RETURN_IF_ERROR(Find(association.get(),
                            {"IMAGE",
                             {{DCM_StudyInstanceUID, study_uid},
                              {DCM_SeriesInstanceUID, series_uid},
                              {DCM_SOPClassUID, ""},
                              {DCM_SOPInstanceUID, ""}}},
                            [&](DcmDataset* answer) {
                              if (is_ct) return;
                              DicomTexts texts(answer);
                              instance = texts.Get(DCM_SOPInstanceUID);
                              is_ct = IsCtClass(texts.Get(DCM_SOPClassUID));
                            }));
    if (!IsDicomUid(instance)) return NotThere("series");
    return instance;
  }

  // An error: the association is broken, and nothing has been added.
  absl::Status StoreOne(DimseAssociation* association, const OutgoingObject& object,
                        std::vector<StoredObject>* stored) {
    const auto context = association->ContextOf(object.class_uid, object.transfer_syntax_uid);
    if (!context.ok()) {
      stored->push_back({object.path, object.instance_uid, context.status()});
      return absl::OkStatus();
    }
    T_DIMSE_C_StoreRQ request = {};
    request.MessageID = association->get()->nextMsgID++;
    OFStandard::strlcpy(request.AffectedSOPClassUID, object.class_uid.c_str(),
                        sizeof(request.AffectedSOPClassUID));
    OFStandard::strlcpy(request.AffectedSOPInstanceUID, object.instance_uid.c_str(),
                        sizeof(request.AffectedSOPInstanceUID));
    request.DataSetType = DIMSE_DATASET_PRESENT;
    request.Priority = DIMSE_PRIORITY_MEDIUM;
    T_DIMSE_C_StoreRSP response = {};
    DcmDataset* detail = nullptr;
    const OFCondition sent =
        DIMSE_storeUser(association->get(), *context, &request, object.path.c_str(), nullptr,
                        nullptr, nullptr, DIMSE_NONBLOCKING, seconds_, &response, &detail);
    delete detail;
    TF_RETURN_IF_ERROR(association->Check(sent, "it was sent an object"));
    stored->push_back(
        {object.path, object.instance_uid, StatusOfStore(object, response.DimseStatus)});
    return absl::OkStatus();
  }

  absl::Status StatusOfStore(const OutgoingObject& object, DIC_US status) const {
    // A UID of ours that it knows is this object, sent before a crash.
    const bool there = status == STATUS_N_DuplicateSOPInstance;
    if (status == STATUS_Success || there || (status & 0xF000) == kWarningClass) {
      return absl::OkStatus();
    }
    const std::string message =
        absl::StrFormat("the PACS '%s' does not take the object %s: status 0x%04x", peer_.name,
                        object.instance_uid, status);
    if ((status & 0xFF00) == STATUS_STORE_Refused_OutOfResources) {
      return absl::UnavailableError(message + " (it has no room): try again later");
    }
    return absl::FailedPreconditionError(message + ": see its log");
  }

  absl::Status NotThere(absl::string_view what) const {
    return absl::NotFoundError(absl::StrCat("the PACS '", peer_.name, "' has no such ", what));
  }

  const PacsPeer peer_;
  const std::shared_ptr<DcmTransportLayer> secure_;
  const int seconds_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PacsClient>> MakeDimseClient(const PacsPeer& peer) {
  TF_RETURN_IF_ERROR(PrepareDicomNetwork());
  for (const std::string& title : {peer.ae_title, peer.own_ae_title}) {
    if (const absl::Status good = CheckAeTitle(title); !good.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the PACS '", peer.name, "': ", good.message()));
    }
  }
  if (peer.host.empty() || peer.port < 1 || peer.port > 65535) {
    return absl::InvalidArgumentError(
        absl::StrCat("the PACS '", peer.name, "' needs a host and a port from 1 to 65535"));
  }
  std::shared_ptr<DcmTransportLayer> secure;
  if (peer.tls) {
    TF_ASSIGN_OR_RETURN(secure, MakeTlsLayer(*peer.tls, TlsRole::kSender, peer.host));
  }
  return std::make_unique<DimseClient>(peer, std::move(secure));
}

}  // namespace tissueform
