// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/storage_association.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dimse.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/instance_stream.h"
#include "client/pacs_bridge/network/socket_layer.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr Uint16 kDuplicate = 0x0111;
constexpr Uint16 kProcessingFailure = 0x0110;

std::string Trimmed(const char* text) { return std::string(absl::StripAsciiWhitespace(text)); }

void Refuse(T_ASC_Association* association, T_ASC_RejectParametersResult result,
            T_ASC_RejectParametersSource source, T_ASC_RejectParametersReason reason) {
  const T_ASC_RejectParameters rejection = {result, source, reason};
  ASC_rejectAssociation(association, &rejection);
}

// Whether this may be asked of us; tells the peer otherwise.
bool Admit(const ReceiverOptions& options, T_ASC_Association* association, bool crowded) {
  const auto& parameters = association->params->DULparams;
  const auto deny = [&](T_ASC_RejectParametersReason reason) {
    Refuse(association, ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER, reason);
    return false;
  };
  if (crowded) {
    Refuse(association, ASC_RESULT_REJECTEDTRANSIENT,
           ASC_SOURCE_SERVICEPROVIDER_PRESENTATION_RELATED, ASC_REASON_SP_PRES_LOCALLIMITEXCEEDED);
    return false;
  }
  if (Trimmed(parameters.applicationContextName) != UID_StandardApplicationContext) {
    return deny(ASC_REASON_SU_APPCONTEXTNAMENOTSUPPORTED);
  }
  if (Trimmed(parameters.calledAPTitle) != options.ae_title) {
    return deny(ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED);
  }
  const auto& titles = options.calling_ae_titles;
  if (std::find(titles.begin(), titles.end(), Trimmed(parameters.callingAPTitle)) == titles.end()) {
    return deny(ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED);
  }
  return true;
}

// The syntax that the sender likes best, whatever it is: nothing is decoded here. Deflated ones
// would be unpacked before any limit of theirs is known.
const char* ChooseSyntax(const T_ASC_PresentationContext& context) {
  for (int i = 0; i < static_cast<int>(context.transferSyntaxCount); ++i) {
    const char* syntax = context.proposedTransferSyntaxes[i];
    if (IsDicomUid(syntax) && syntax != kDeflatedLittleEndian) return syntax;
  }
  return nullptr;
}

// False: nothing that was offered is taken.
bool Negotiate(T_ASC_Parameters* parameters) {
  const int count = ASC_countPresentationContexts(parameters);
  for (int i = 0; i < count; ++i) {
    T_ASC_PresentationContext context;
    if (ASC_getPresentationContext(parameters, i, &context).bad()) continue;
    const bool known = context.abstractSyntax == kVerificationClass ||
                       dcmIsaStorageSOPClassUID(context.abstractSyntax, ESSC_All) == OFTrue;
    const char* syntax = ChooseSyntax(context);
    if (known && syntax != nullptr) {
      ASC_acceptPresentationContext(parameters, context.presentationContextID, syntax);
    } else {
      ASC_refusePresentationContext(
          parameters, context.presentationContextID,
          known ? ASC_P_TRANSFERSYNTAXESNOTSUPPORTED : ASC_P_ABSTRACTSYNTAXNOTSUPPORTED);
    }
  }
  return ASC_countAcceptedPresentationContexts(parameters) > 0;
}

Uint16 StoreStatus(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return STATUS_STORE_Success;
    case absl::StatusCode::kResourceExhausted:
      return STATUS_STORE_Refused_OutOfResources;
    case absl::StatusCode::kAlreadyExists:
      return kDuplicate;
    case absl::StatusCode::kInvalidArgument:
      return STATUS_STORE_Error_CannotUnderstand;
    case absl::StatusCode::kUnimplemented:
      return STATUS_STORE_Refused_SOPClassNotSupported;
    default:
      return kProcessingFailure;
  }
}

// Why nothing of this object is kept, before a byte of it has come.
absl::Status CheckRequest(const AnnouncedInstance& announced, absl::string_view abstract_syntax,
                          const InstanceFolder& folder) {
  if (!IsDicomUid(announced.instance_uid)) {
    return absl::InvalidArgumentError("an object's UID is no UID");
  }
  if (announced.class_uid != abstract_syntax) {
    return absl::UnimplementedError("an object is of another class than its presentation context");
  }
  return folder.CheckRoom();
}

struct ServedAssociation {
  std::unique_ptr<SocketLayer> layer;
  T_ASC_Network* network = nullptr;
  T_ASC_Association* association = nullptr;

  ServedAssociation() = default;
  ServedAssociation(const ServedAssociation&) = delete;
  ServedAssociation& operator=(const ServedAssociation&) = delete;
  ~ServedAssociation() {
    if (association != nullptr) {
      ASC_dropSCPAssociation(association, 1);
      ASC_destroyAssociation(&association);
    }
    if (network != nullptr) ASC_dropNetwork(&network);
  }
};

// Answers commands until the association ends; fills in how.
class CommandLoop {
 public:
  CommandLoop(const AssociationContext& context, T_ASC_Association* association,
              EndedAssociation* ended)
      : context_(context), association_(association), ended_(ended) {}

  void Run() {
    while (Next()) continue;
  }

 private:
  // False: it has ended.
  bool Next() {
    const int seconds = static_cast<int>(context_.options->idle_time.count());
    T_ASC_PresentationContextID presentation = 0;
    T_DIMSE_Message message = {};
    DcmDataset* detail = nullptr;
    const OFCondition received = DIMSE_receiveCommand(association_, DIMSE_NONBLOCKING, seconds,
                                                      &presentation, &message, &detail);
    delete detail;
    if (received == DUL_PEERREQUESTEDRELEASE) {
      ended_->released = ASC_acknowledgeRelease(association_).good();
      return false;
    }
    if (received == DUL_PEERABORTEDASSOCIATION) return End("the sender has aborted it", false);
    if (received == DIMSE_NODATAAVAILABLE) return End("the sender was silent for too long", true);
    if (received.bad()) return End("it broke off, or what came was no command", true);
    switch (message.CommandField) {
      case DIMSE_C_ECHO_RQ:
        return DIMSE_sendEchoResponse(association_, presentation, &message.msg.CEchoRQ,
                                      STATUS_Success, nullptr)
                   .good() ||
               End("it broke off", true);
      case DIMSE_C_STORE_RQ:
        return Store(presentation, message.msg.CStoreRQ);
      default:
        return End("it asked for something else than storing", true);
    }
  }

  bool Store(T_ASC_PresentationContextID presentation, const T_DIMSE_C_StoreRQ& request) {
    AnnouncedInstance announced;
    announced.calling_ae = ended_->calling_ae;
    announced.address = ended_->address;
    announced.association = ended_->association;
    absl::Status status;
    const absl::Status broken =
        ReceiveStore(association_, presentation, request, std::move(announced),
                     static_cast<int>(context_.options->idle_time.count()), *context_.folder,
                     context_.sink, &status);
    if (!broken.ok()) return End(broken.message(), true);
    if (status.ok()) {
      ++ended_->kept;
      ++*context_.kept;
    } else {
      ++ended_->refused;
      if (ended_->problem.empty()) ended_->problem = std::string(status.message());
    }
    return true;
  }

  bool End(absl::string_view problem, bool abort) {
    ended_->problem = std::string(problem);
    if (abort) ASC_abortAssociation(association_);
    return false;
  }

  const AssociationContext& context_;
  T_ASC_Association* const association_;
  EndedAssociation* const ended_;
};

}  // namespace

absl::Status ReceiveStore(T_ASC_Association* association, int presentation_context,
                          const T_DIMSE_C_StoreRQ& request, AnnouncedInstance announced,
                          int idle_seconds, const InstanceFolder& folder, InstanceSink* sink,
                          absl::Status* status) {
  auto presentation = static_cast<T_ASC_PresentationContextID>(presentation_context);
  T_ASC_PresentationContext context;
  if (ASC_findAcceptedPresentationContext(association->params, presentation, &context).bad() ||
      request.DataSetType == DIMSE_DATASET_NULL) {
    return absl::InvalidArgumentError("a request without a data set or presentation context");
  }
  announced.class_uid = Trimmed(request.AffectedSOPClassUID);
  announced.instance_uid = Trimmed(request.AffectedSOPInstanceUID);
  announced.transfer_syntax_uid = Trimmed(context.acceptedTransferSyntax);
  *status = CheckRequest(announced, Trimmed(context.abstractSyntax), folder);
  std::optional<PartialFile> partial;
  if (status->ok()) {
    absl::StatusOr<PartialFile> created = folder.NewPartial();
    *status = created.status();
    if (created.ok()) partial.emplace(*std::move(created));
  }
  const std::unique_ptr<InstanceStream> stream =
      partial ? std::make_unique<InstanceStream>(partial->path(), announced,
                                                 folder.options().limits.max_file_bytes)
              : std::make_unique<InstanceStream>(*status);
  const OFCondition received = DIMSE_receiveDataSetInFile(
      association, DIMSE_NONBLOCKING, idle_seconds, &presentation, stream.get(), nullptr, nullptr);
  if (received.bad()) {
    return absl::UnavailableError("it broke off in the middle of an object");
  }
  *status = stream->Close();
  if (status->ok()) *status = folder.Take(*std::move(partial), announced, sink).status();
  T_DIMSE_C_StoreRSP response = {};
  response.DimseStatus = StoreStatus(*status);
  if (DIMSE_sendStoreResponse(association, presentation, &request, &response, nullptr).bad()) {
    return absl::UnavailableError("it broke off before an answer");
  }
  return absl::OkStatus();
}

void ServeAssociation(const AssociationContext& context, int socket, const std::string& address,
                      int64_t number, bool crowded) {
  ServedAssociation served;
  const OFCondition received =
      ReceiveAssociationFrom(socket, context.secure, context.options->connect_time, &served.layer,
                             &served.network, &served.association);
  if (received.bad() || !Admit(*context.options, served.association, crowded)) {
    ++*context.refused;
    return;
  }
  if (!Negotiate(served.association->params)) {
    Refuse(served.association, ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER,
           ASC_REASON_SU_NOREASON);
    ++*context.refused;
    return;
  }
  if (ASC_acknowledgeAssociation(served.association).bad()) return;
  ++*context.accepted;
  EndedAssociation ended;
  ended.association = number;
  ended.calling_ae = Trimmed(served.association->params->DULparams.callingAPTitle);
  ended.address = address;
  CommandLoop(context, served.association, &ended).Run();
  context.sink->AssociationEnded(ended);
}

}  // namespace tissueform
