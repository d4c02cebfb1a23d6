// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/network/pacs_client.h"

namespace tissueform {

// A PACS that is asked by DICOMweb (PS3.18): QIDO-RS, WADO-RS, STOW-RS.
// Errors: those of MakePacsClient.
absl::StatusOr<std::unique_ptr<PacsClient>> MakeDicomWebClient(const PacsPeer& peer);

}  // namespace tissueform
