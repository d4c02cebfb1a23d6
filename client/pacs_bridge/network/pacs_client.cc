// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/pacs_client.h"

#include "client/pacs_bridge/network/dicom_web_client.h"
#include "client/pacs_bridge/network/dimse_client.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<PacsClient>> MakePacsClient(const PacsPeer& peer) {
  return peer.kind == PacsPeer::Kind::kDimse ? MakeDimseClient(peer) : MakeDicomWebClient(peer);
}

}  // namespace tissueform
