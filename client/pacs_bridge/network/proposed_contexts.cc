// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/proposed_contexts.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcuid.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"

namespace tissueform {
namespace {

std::vector<std::string> Uncompressed() {
  return {std::string(kExplicitLittleEndian), std::string(kImplicitLittleEndian)};
}

}  // namespace

std::vector<ProposedContext> FindContexts() {
  return {{UID_FINDStudyRootQueryRetrieveInformationModel, Uncompressed()}};
}

std::vector<ProposedContext> MoveContexts() {
  return {{UID_MOVEStudyRootQueryRetrieveInformationModel, Uncompressed()}};
}

std::vector<ProposedContext> GetContexts() {
  std::vector<ProposedContext> contexts = {
      {UID_GETStudyRootQueryRetrieveInformationModel, Uncompressed()}};
  for (const char* image : {UID_CTImageStorage, UID_MRImageStorage, UID_EnhancedCTImageStorage,
                            UID_XRay3DCraniofacialImageStorage}) {
    contexts.push_back({image, Uncompressed(), true});
    // One context for each: the peer keeps what it has instead of decoding it.
    for (const char* compressed :
         {UID_JPEGProcess14SV1TransferSyntax, UID_JPEGLSLosslessTransferSyntax,
          UID_JPEG2000LosslessOnlyTransferSyntax, UID_JPEG2000TransferSyntax,
          UID_RLELosslessTransferSyntax, UID_JPEGProcess2_4TransferSyntax}) {
      contexts.push_back({image, {compressed}, true});
    }
  }
  for (const char* other :
       {UID_SecondaryCaptureImageStorage, UID_MultiframeTrueColorSecondaryCaptureImageStorage,
        UID_EncapsulatedSTLStorage, UID_BasicTextSRStorage, UID_EnhancedSRStorage,
        UID_ComprehensiveSRStorage, UID_Comprehensive3DSRStorage, UID_EncapsulatedPDFStorage}) {
    contexts.push_back({other, Uncompressed(), true});
  }
  return contexts;
}

}  // namespace tissueform
