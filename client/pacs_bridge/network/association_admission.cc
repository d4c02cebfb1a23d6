// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/association_admission.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/assoc.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"

namespace tissueform {
namespace {

std::string WithoutPadding(const char* text) {
  return std::string(absl::StripAsciiWhitespace(text));
}

void Refuse(T_ASC_Association* association, T_ASC_RejectParametersResult result,
            T_ASC_RejectParametersSource source, T_ASC_RejectParametersReason reason) {
  const T_ASC_RejectParameters rejection = {result, source, reason};
  ASC_rejectAssociation(association, &rejection);
}

// The sender's preferred syntax, of any kind: nothing is decoded here. Not deflated ones: they
// would be unpacked before any limit of theirs is known.
const char* ChooseSyntax(const T_ASC_PresentationContext& context) {
  for (int i = 0; i < static_cast<int>(context.transferSyntaxCount); ++i) {
    const char* syntax = context.proposedTransferSyntaxes[i];
    if (IsDicomUid(syntax) && syntax != kDeflatedLittleEndian) return syntax;
  }
  return nullptr;
}

}  // namespace

absl::Status AdmitAssociation(const ReceiverOptions& options, T_ASC_Association* association,
                              bool crowded) {
  const auto& parameters = association->params->DULparams;
  const auto deny = [&](T_ASC_RejectParametersReason reason, const char* text) {
    Refuse(association, ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER, reason);
    return absl::PermissionDeniedError(text);
  };
  if (crowded) {
    Refuse(association, ASC_RESULT_REJECTEDTRANSIENT,
           ASC_SOURCE_SERVICEPROVIDER_PRESENTATION_RELATED, ASC_REASON_SP_PRES_LOCALLIMITEXCEEDED);
    return absl::UnavailableError("too many associations are open");
  }
  if (WithoutPadding(parameters.applicationContextName) != UID_StandardApplicationContext) {
    return deny(ASC_REASON_SU_APPCONTEXTNAMENOTSUPPORTED, "unknown application context");
  }
  if (WithoutPadding(parameters.calledAPTitle) != options.ae_title) {
    return deny(ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED, "wrong called AE title");
  }
  const auto& titles = options.calling_ae_titles;
  if (std::find(titles.begin(), titles.end(), WithoutPadding(parameters.callingAPTitle)) ==
      titles.end()) {
    return deny(ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED, "unknown calling AE title");
  }
  return absl::OkStatus();
}

bool NegotiateAssociation(T_ASC_Association* association) {
  T_ASC_Parameters* parameters = association->params;
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
  if (ASC_countAcceptedPresentationContexts(parameters) > 0) return true;
  Refuse(association, ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER, ASC_REASON_SU_NOREASON);
  return false;
}

std::string CallingTitleOf(const T_ASC_Association& association) {
  return WithoutPadding(association.params->DULparams.callingAPTitle);
}

}  // namespace tissueform
