// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dimse_queries.h"

#include <algorithm>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dimse.h>

#include "client/pacs_bridge/network/store_request.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr DIC_US kMoveDestinationUnknown = 0xA801;

DcmDataset IdentifierOf(const StudyRootQuery& query) {
  DcmDataset identifier;
  identifier.putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 192");
  identifier.putAndInsertString(DCM_QueryRetrieveLevel, query.level.c_str());
  for (const auto& [tag, value] : query.keys) {
    identifier.putAndInsertString(DcmTag(tag), value.c_str());
  }
  return identifier;
}

bool IsPending(DIC_US status) { return (status & 0xFF00) == 0xFF00; }

absl::Status Failed(const std::string& peer, absl::string_view what, DIC_US status) {
  if (status == kMoveDestinationUnknown) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the PACS '", peer, "' does not know where our AE title is: enter host and port there"));
  }
  return absl::FailedPreconditionError(absl::StrFormat(
      "the PACS '%s' answers %s with status 0x%04x: see its log", peer, what, status));
}

struct FindAnswers {
  const std::function<void(DcmDataset*)>* take;
};

void OnFindAnswer(void* data, T_DIMSE_C_FindRQ* /*request*/, int count, T_DIMSE_C_FindRSP* /*head*/,
                  DcmDataset* answer) {
  if (answer != nullptr && count <= kMaxAnswers) (*static_cast<FindAnswers*>(data)->take)(answer);
}

// The messages of one C-GET, until its last answer.
class GetSession {
 public:
  GetSession(std::string peer, DimseAssociation* association, int seconds)
      : peer_(std::move(peer)), association_(association), seconds_(seconds) {}

  absl::StatusOr<FetchCounts> Run(const AnnouncedInstance& announced, const InstanceFolder& folder,
                                  InstanceSink* sink) {
    while (true) {
      T_ASC_PresentationContextID context = 0;
      T_DIMSE_Message message = {};
      DcmDataset* detail = nullptr;
      const OFCondition received = DIMSE_receiveCommand(association_->get(), DIMSE_NONBLOCKING,
                                                        seconds_, &context, &message, &detail);
      delete detail;
      TF_RETURN_IF_ERROR(association_->Check(received, "it sends objects"));
      if (message.CommandField == DIMSE_C_STORE_RQ) {
        absl::Status kept;
        const absl::Status broken = ReceiveStore(association_->get(), context, message.msg.CStoreRQ,
                                                 announced, seconds_, folder, sink, &kept);
        if (!broken.ok()) return association_->Check(DIMSE_BADDATA, "it sent an object");
        if (!kept.ok() && first_problem_.ok()) first_problem_ = kept;
        ++(kept.ok() ? counts_.completed : counts_.failed);
        continue;
      }
      if (message.CommandField != DIMSE_C_GET_RSP) {
        return association_->Check(DIMSE_BADCOMMANDTYPE, "it sent objects");
      }
      TF_RETURN_IF_ERROR(SkipData(message.msg.CGetRSP));
      if (!IsPending(message.msg.CGetRSP.DimseStatus)) return End(message.msg.CGetRSP);
    }
  }

 private:
  absl::Status SkipData(const T_DIMSE_C_GetRSP& answer) {
    if (answer.DataSetType == DIMSE_DATASET_NULL) return absl::OkStatus();
    DIC_UL bytes = 0;
    DIC_UL pieces = 0;
    return association_->Check(
        DIMSE_ignoreDataSet(association_->get(), DIMSE_NONBLOCKING, seconds_, &bytes, &pieces),
        "it told how it went");
  }

  absl::StatusOr<FetchCounts> End(const T_DIMSE_C_GetRSP& answer) {
    counts_.failed = std::max(counts_.failed, int{answer.NumberOfFailedSubOperations});
    if (counts_.completed > 0 || counts_.failed > 0) {
      // A full disk is our own error to report: trying again at once would not help.
      if (counts_.completed == 0 && !first_problem_.ok()) return first_problem_;
      return counts_;
    }
    if (answer.DimseStatus == STATUS_Success) return counts_;
    return Failed(peer_, "a request for objects (C-GET)", answer.DimseStatus);
  }

  const std::string peer_;
  DimseAssociation* const association_;
  const int seconds_;
  FetchCounts counts_;
  absl::Status first_problem_;
};

}  // namespace

absl::Status FindByDimse(const std::string& peer_name, DimseAssociation* association,
                         const StudyRootQuery& query, int silence_seconds,
                         const std::function<void(DcmDataset* answer)>& take) {
  TF_ASSIGN_OR_RETURN(const T_ASC_PresentationContextID context,
                      association->ContextOf(UID_FINDStudyRootQueryRetrieveInformationModel));
  T_DIMSE_C_FindRQ request = {};
  request.MessageID = association->get()->nextMsgID++;
  OFStandard::strlcpy(request.AffectedSOPClassUID, UID_FINDStudyRootQueryRetrieveInformationModel,
                      sizeof(request.AffectedSOPClassUID));
  request.Priority = DIMSE_PRIORITY_MEDIUM;
  request.DataSetType = DIMSE_DATASET_PRESENT;
  DcmDataset identifier = IdentifierOf(query);
  T_DIMSE_C_FindRSP response = {};
  int count = 0;
  FindAnswers answers = {&take};
  DcmDataset* detail = nullptr;
  const OFCondition found =
      DIMSE_findUser(association->get(), context, &request, &identifier, count, &OnFindAnswer,
                     &answers, DIMSE_NONBLOCKING, silence_seconds, &response, &detail);
  delete detail;
  TF_RETURN_IF_ERROR(association->Check(found, "it answered a query"));
  if (response.DimseStatus == STATUS_Success) return absl::OkStatus();
  return Failed(peer_name, "a query (C-FIND)", response.DimseStatus);
}

absl::StatusOr<FetchCounts> MoveByDimse(const std::string& peer_name, DimseAssociation* association,
                                        const StudyRootQuery& query, const std::string& destination,
                                        int silence_seconds) {
  TF_ASSIGN_OR_RETURN(const T_ASC_PresentationContextID context,
                      association->ContextOf(UID_MOVEStudyRootQueryRetrieveInformationModel));
  T_DIMSE_C_MoveRQ request = {};
  request.MessageID = association->get()->nextMsgID++;
  OFStandard::strlcpy(request.AffectedSOPClassUID, UID_MOVEStudyRootQueryRetrieveInformationModel,
                      sizeof(request.AffectedSOPClassUID));
  request.Priority = DIMSE_PRIORITY_MEDIUM;
  request.DataSetType = DIMSE_DATASET_PRESENT;
  OFStandard::strlcpy(request.MoveDestination, destination.c_str(),
                      sizeof(request.MoveDestination));
  DcmDataset identifier = IdentifierOf(query);
  T_DIMSE_C_MoveRSP response = {};
  DcmDataset* detail = nullptr;
  DcmDataset* failed = nullptr;
  const OFCondition moved = DIMSE_moveUser(
      association->get(), context, &request, &identifier, nullptr, nullptr, DIMSE_NONBLOCKING,
      silence_seconds, association->network(), nullptr, nullptr, &response, &detail, &failed);
  delete detail;
  delete failed;
  TF_RETURN_IF_ERROR(association->Check(moved, "it sent objects to our receiver"));
  const FetchCounts counts = {
      response.NumberOfCompletedSubOperations + response.NumberOfWarningSubOperations,
      response.NumberOfFailedSubOperations};
  if (response.DimseStatus == STATUS_Success || counts.completed > 0 || counts.failed > 0) {
    return counts;
  }
  return Failed(peer_name, "a request for objects (C-MOVE)", response.DimseStatus);
}

absl::StatusOr<FetchCounts> GetByDimse(const std::string& peer_name, DimseAssociation* association,
                                       const StudyRootQuery& query, int silence_seconds,
                                       const AnnouncedInstance& announced,
                                       const InstanceFolder& folder, InstanceSink* sink) {
  TF_ASSIGN_OR_RETURN(const T_ASC_PresentationContextID context,
                      association->ContextOf(UID_GETStudyRootQueryRetrieveInformationModel));
  T_DIMSE_Message message = {};
  message.CommandField = DIMSE_C_GET_RQ;
  T_DIMSE_C_GetRQ& request = message.msg.CGetRQ;
  request.MessageID = association->get()->nextMsgID++;
  OFStandard::strlcpy(request.AffectedSOPClassUID, UID_GETStudyRootQueryRetrieveInformationModel,
                      sizeof(request.AffectedSOPClassUID));
  request.Priority = DIMSE_PRIORITY_MEDIUM;
  request.DataSetType = DIMSE_DATASET_PRESENT;
  DcmDataset identifier = IdentifierOf(query);
  TF_RETURN_IF_ERROR(
      association->Check(DIMSE_sendMessageUsingMemoryData(association->get(), context, &message,
                                                          nullptr, &identifier, nullptr, nullptr),
                         "it was asked for objects"));
  return GetSession(peer_name, association, silence_seconds).Run(announced, folder, sink);
}

}  // namespace tissueform
