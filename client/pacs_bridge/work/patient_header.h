// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/work/cached_header.h"

namespace tissueform {

// Puts what the PACS says of the patient now into the file `path`. Where it offers no service that
// gives a header, the kept one stands for it as long as it may, if the PACS's query for the study
// names the same patient; or offers no query either. Then no file is written unless it stands. An
// ID or a name must be the same; issuer and birth date only where the PACS returns them, which it
// need not do.
//
// Errors: FailedPrecondition: the PACS has the series no longer, or offers no header and none is
// kept; Unavailable: it refuses to answer, which it may do again or not; those of PacsClient.
absl::StatusOr<FoundPatient> FetchPatientHeader(PacsClient* pacs, const CachedHeader& known,
                                                const std::string& path);

// The note for a person when the patient is not the one that was seen; it identifies neither.
std::string WhatHasChanged(const PatientIdentity& seen, const PatientIdentity& now);

}  // namespace tissueform
