// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/storage_association.h"

#include <memory>
#include <utility>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dimse.h>

#include "client/pacs_bridge/network/association_admission.h"
#include "client/pacs_bridge/network/socket_layer.h"
#include "client/pacs_bridge/network/store_request.h"

namespace tissueform {
namespace {

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
    if (received == DUL_PEERABORTEDASSOCIATION) return End("the sender aborted it", false);
    if (received == DIMSE_NODATAAVAILABLE) return End("the sender was silent for too long", true);
    if (received.bad()) return End("it was interrupted, or sent no command", true);
    switch (message.CommandField) {
      case DIMSE_C_ECHO_RQ:
        return DIMSE_sendEchoResponse(association_, presentation, &message.msg.CEchoRQ,
                                      STATUS_Success, nullptr)
                   .good() ||
               End("it broke off", true);
      case DIMSE_C_STORE_RQ:
        return Store(presentation, message.msg.CStoreRQ);
      default:
        return End("it requested something other than storage", true);
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

void ServeAssociation(const AssociationContext& context, int socket, const std::string& address,
                      int64_t number, bool crowded) {
  ServedAssociation served;
  const OFCondition received =
      ReceiveAssociationFrom(socket, context.secure, context.options->connect_time, &served.layer,
                             &served.network, &served.association);
  absl::Status admitted =
      received.bad() ? absl::InvalidArgumentError("no valid association request, or TLS failed")
                     : AdmitAssociation(*context.options, served.association, crowded);
  if (admitted.ok() && !NegotiateAssociation(served.association)) {
    admitted = absl::InvalidArgumentError("no presentation context that is accepted");
  }
  if (!admitted.ok()) {
    ++*context.refused;
    context.sink->ConnectionRefused(
        {.address = address,
         .calling_ae = received.bad() ? "" : CallingTitleOf(*served.association),
         .reason = std::string(admitted.message())});
    return;
  }
  if (ASC_acknowledgeAssociation(served.association).bad()) return;
  ++*context.accepted;
  EndedAssociation ended;
  ended.association = number;
  ended.calling_ae = CallingTitleOf(*served.association);
  ended.address = address;
  CommandLoop(context, served.association, &ended).Run();
  context.sink->AssociationEnded(ended);
}

}  // namespace tissueform
