// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dimse_association.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/dcmnet/dimse.h>
#include <dcmtk/dcmnet/dul.h>
#include <dcmtk/ofstd/ofstd.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status Rejected(const PacsPeer& peer, T_ASC_Parameters* parameters) {
  T_ASC_RejectParameters rejection = {};
  ASC_getRejectParameters(parameters, &rejection);
  if (rejection.result == ASC_RESULT_REJECTEDTRANSIENT) {
    return absl::UnavailableError(
        absl::StrCat("the PACS '", peer.name, "' has no room for us now: try again"));
  }
  switch (rejection.reason) {
    case ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED:
      return absl::PermissionDeniedError(absl::StrCat("the PACS '", peer.name,
                                                      "' does not know our AE title ",
                                                      peer.own_ae_title, ": enter it there"));
    case ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED:
      return absl::PermissionDeniedError(absl::StrCat("the PACS '", peer.name, "' is not called ",
                                                      peer.ae_title,
                                                      ": correct its AE title here"));
    default:
      return absl::PermissionDeniedError(absl::StrCat(
          "the PACS '", peer.name, "' refuses associations from us: ask its operator why"));
  }
}

absl::Status NotReached(const PacsPeer& peer, const OFCondition& condition, bool secure,
                        bool connected) {
  const std::string where =
      absl::StrCat("the PACS '", peer.name, "' at ", peer.host, ":", peer.port);
  if (condition.code() == DULC_UNKNOWNHOST) {
    return absl::UnavailableError(absl::StrCat(where, ": the host is not known"));
  }
  if (condition.code() == DULC_READTIMEOUT) {
    return absl::DeadlineExceededError(
        absl::StrCat(where, " is silent: does it speak DICOM there", secure ? "?" : ", or TLS?"));
  }
  if (!connected) {
    return absl::UnavailableError(absl::StrCat(where, " does not answer: is it running there?"));
  }
  if (secure) {
    return absl::UnauthenticatedError(absl::StrCat(
        where, ": the TLS handshake fails: compare certificates and authorities of both sides"));
  }
  return absl::UnavailableError(absl::StrCat(where, " hangs up: does it let us in, or want TLS?"));
}

}  // namespace

absl::Status CheckAeTitle(const std::string& title) {
  constexpr size_t kMaxCharacters = 16;
  const bool is_good =
      !title.empty() && title.size() <= kMaxCharacters &&
      std::all_of(title.begin(), title.end(), [](char letter) {
        return absl::ascii_isprint(static_cast<unsigned char>(letter)) && letter != '\\';
      });
  if (is_good) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the AE title '", absl::CHexEscape(title),
                   "' is invalid: write 1 to 16 ASCII characters without a backslash"));
}

absl::StatusOr<std::unique_ptr<DimseAssociation>> DimseAssociation::Request(
    const PacsPeer& peer, DcmTransportLayer* secure, const std::vector<ProposedContext>& contexts) {
  std::unique_ptr<DimseAssociation> association(new DimseAssociation(peer.name));
  TF_RETURN_IF_ERROR(association->Open(peer, secure, contexts));
  return association;
}

absl::Status DimseAssociation::Open(const PacsPeer& peer, DcmTransportLayer* secure,
                                    const std::vector<ProposedContext>& contexts) {
  const int connect_seconds = static_cast<int>(peer.connect_time.count());
  dcmConnectionTimeout.set(connect_seconds);
  layer_ = std::make_unique<SocketLayer>(secure, peer.answer_time);
  T_ASC_Parameters* parameters = nullptr;
  if (ASC_initializeNetwork(NET_REQUESTOR, 0, connect_seconds, &network_).bad() ||
      ASC_setTransportLayer(network_, layer_.get(), 0).bad() ||
      ASC_createAssociationParameters(&parameters, ASC_MAXIMUMPDUSIZE).bad()) {
    return absl::InternalError("DCMTK's network does not start");
  }
  ASC_setAPTitles(parameters, peer.own_ae_title.c_str(), peer.ae_title.c_str(), nullptr);
  ASC_setTransportLayerType(parameters, secure == nullptr ? OFFalse : OFTrue);
  ASC_setPresentationAddresses(parameters, OFStandard::getHostName().c_str(),
                               absl::StrCat(peer.host, ":", peer.port).c_str());
  int number = 1;  // odd ones
  for (const ProposedContext& context : contexts) {
    std::vector<const char*> syntaxes;
    syntaxes.reserve(context.transfer_syntaxes.size());
    for (const std::string& syntax : context.transfer_syntaxes) syntaxes.push_back(syntax.c_str());
    ASC_addPresentationContext(parameters, static_cast<T_ASC_PresentationContextID>(number),
                               context.abstract_syntax.c_str(), syntaxes.data(),
                               static_cast<int>(syntaxes.size()),
                               context.we_receive ? ASC_SC_ROLE_SCP : ASC_SC_ROLE_DEFAULT);
    number += 2;
  }
  const OFCondition asked = ASC_requestAssociation(network_, parameters, &association_, nullptr,
                                                   nullptr, DUL_NOBLOCK, connect_seconds);
  if (asked.good()) return absl::OkStatus();
  broken_ = true;
  absl::Status status = asked == DUL_ASSOCIATIONREJECTED
                            ? Rejected(peer, parameters)
                            : NotReached(peer, asked, secure != nullptr, layer_->has_socket());
  if (association_ == nullptr) ASC_destroyAssociationParameters(&parameters);
  return status;
}

DimseAssociation::~DimseAssociation() {
  if (association_ != nullptr) {
    if (!broken_) {
      ASC_releaseAssociation(association_);
    } else if (association_->DULassociation != nullptr) {
      ASC_abortAssociation(association_);
    }
    ASC_destroyAssociation(&association_);
  }
  if (network_ != nullptr) ASC_dropNetwork(&network_);
}

absl::StatusOr<T_ASC_PresentationContextID> DimseAssociation::ContextOf(
    const std::string& abstract_syntax, const std::string& transfer_syntax) {
  T_ASC_PresentationContextID context = 0;
  if (!transfer_syntax.empty()) {
    context = ASC_findAcceptedPresentationContextID(association_, abstract_syntax.c_str(),
                                                    transfer_syntax.c_str());
  }
  if (context == 0 && transfer_syntax.empty()) {
    context = ASC_findAcceptedPresentationContextID(association_, abstract_syntax.c_str());
  }
  if (context != 0) return context;
  if (transfer_syntax.empty()) {
    return absl::UnimplementedError(absl::StrCat("the PACS '", peer_name_,
                                                 "' does not offer the service ", abstract_syntax,
                                                 ": allow it there"));
  }
  return absl::FailedPreconditionError(
      absl::StrCat("the PACS '", peer_name_, "' does not take the class ", abstract_syntax,
                   " in the transfer syntax ", transfer_syntax, ": allow it there"));
}

absl::Status DimseAssociation::Check(const OFCondition& condition, absl::string_view what) {
  if (condition.good()) return absl::OkStatus();
  broken_ = true;
  if (condition == DIMSE_NODATAAVAILABLE || condition.code() == DULC_READTIMEOUT) {
    return absl::DeadlineExceededError(
        absl::StrCat("the PACS '", peer_name_, "' was silent for too long while ", what));
  }
  return absl::UnavailableError(
      absl::StrCat("the PACS '", peer_name_, "' broke off while ", what, ": try again"));
}

}  // namespace tissueform
