// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/queue/received_rows.h"

namespace tissueform {

// A header of a series that the bridge has kept, without pixels.
struct KeptHeader {
  const QueuedSeries& series;
  std::string kept = {};  // its file, where series.has_header
  std::chrono::seconds lifetime{0};
};

// Whose a series is now.
struct FoundPatient {
  PatientIdentity patient = {};
  // False: the PACS gives nobody a header, and names another patient than the one that is kept.
  bool has_header = true;
  // Where the header is not the PACS's own: why, in one line without anything of a patient.
  std::string remark = {};
};

// Puts what the PACS says of the patient now into the file `path`. Where it offers no service that
// gives a header, the kept one stands for it as long as it may, if the PACS's query for the study
// names the same patient; or offers no query either. Then no file is written unless it stands. An
// ID or a name must be the same; issuer and birth date, which a PACS need not tell, where it tells
// them.
//
// Errors: FailedPrecondition: the PACS has the series no longer, or offers no header and none is
// kept; Unavailable: it refuses to answer, which it may do again or not; those of PacsClient.
absl::StatusOr<FoundPatient> FetchPatientHeader(PacsClient* pacs, const KeptHeader& known,
                                                const std::string& path);

// What a person is told of a patient who is not the one that was seen; says of neither who it is.
std::string WhatHasChanged(const PatientIdentity& seen, const PatientIdentity& now);

}  // namespace tissueform
