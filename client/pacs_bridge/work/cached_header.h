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
struct CachedHeader {
  const QueuedSeries& series;
  std::string kept = {};  // its file, where series.has_header
  std::chrono::seconds lifetime{0};
};

// Whose a series is now.
struct FoundPatient {
  PatientIdentity patient = {};
  // False: the PACS returns no headers, and names another patient than the one that is kept.
  bool has_header = true;
  // Where the header is not the PACS's own: why, in one line without anything of a patient.
  std::string remark = {};
};

// For a PACS that offers no service that gives a header: copies the kept one to `path`, if it is
// young enough and the PACS's query names the same patient, or there is no query either.
//
// Errors: FailedPrecondition: no header is kept now, or SeriesIsGone; Refused; of the disk.
absl::StatusOr<FoundPatient> TakeKeptHeader(PacsClient* pacs, const CachedHeader& known,
                                            const std::string& path);

// Of the header at `path`. Errors: FailedPrecondition: it is of another series.
absl::StatusOr<PatientIdentity> PatientIn(const std::string& path, const QueuedSeries& series);

absl::Status SeriesIsGone();
// What a PACS refuses now it may answer later, so FailedPrecondition becomes Unavailable: no reason
// to give up, nor to take another answer in its place.
absl::Status Refused(const absl::Status& status);

}  // namespace tissueform
