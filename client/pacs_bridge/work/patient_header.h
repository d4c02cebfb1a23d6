// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/queue/received_rows.h"

namespace tissueform {

// A header of a series that the bridge has kept, without pixels.
struct KeptHeader {
  const QueuedSeries& series;
  std::string kept = {};  // its file, where series.has_header
  std::chrono::seconds lifetime{0};
};

// Puts what the PACS says of the patient now into the file `path`. Only where it gives nobody a
// header (it offers no query) the kept one stands for it, as long as it may.
//
// Errors: FailedPrecondition: the PACS has the series no longer, or gives no header and none is
// kept; those of PacsClient.
absl::Status FetchPatientHeader(PacsClient* pacs, const KeptHeader& known, const std::string& path);

// What a person is told of a patient who is not the one that was seen; says of neither who it is.
std::string WhatHasChanged(const PatientIdentity& seen, const PatientIdentity& now);

}  // namespace tissueform
