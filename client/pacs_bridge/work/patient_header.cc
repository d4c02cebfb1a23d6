// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/patient_header.h"

#include <filesystem>
#include <system_error>

#include "core/base/status_macros.h"

namespace tissueform {

absl::StatusOr<FoundPatient> FetchPatientHeader(PacsClient* pacs, const CachedHeader& known,
                                                const std::string& path) {
  const QueuedSeries& series = known.series;
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  const absl::Status fetched = pacs->FetchHeader(series.study_uid, series.uid, path);
  if (absl::IsUnimplemented(fetched)) return TakeKeptHeader(pacs, known, path);
  if (absl::IsNotFound(fetched)) return SeriesIsGone();
  if (!fetched.ok()) return Refused(fetched);
  FoundPatient found;
  TF_ASSIGN_OR_RETURN(found.patient, PatientIn(path, series));
  return found;
}

std::string WhatHasChanged(const PatientIdentity& seen, const PatientIdentity& now) {
  if (!now.readable) {
    return "the name has an unknown character set; compare with the PACS";
  }
  if (seen.id != now.id || seen.issuer != now.issuer) {
    return "the PACS names another patient ID than the images that were received (a merged or "
           "corrected patient?)";
  }
  if (seen.name != now.name || seen.birth_date != now.birth_date) {
    return "the PACS names another name or birth date than the images that were received";
  }
  return "the patient was corrected after it was confirmed";
}

}  // namespace tissueform
