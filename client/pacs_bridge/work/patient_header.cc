// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/patient_header.h"

#include <cstdint>
#include <ctime>
#include <filesystem>
#include <system_error>

#include "server/store/durable_file.h"

namespace tissueform {

namespace fs = std::filesystem;

absl::Status FetchPatientHeader(PacsClient* pacs, const KeptHeader& known,
                                const std::string& path) {
  const QueuedSeries& series = known.series;
  std::error_code ignored;
  fs::remove(path, ignored);
  const absl::Status fetched = pacs->FetchHeader(series.study_uid, series.uid, path);
  if (fetched.ok()) return absl::OkStatus();
  if (absl::IsNotFound(fetched)) {
    return absl::FailedPreconditionError(
        "the PACS has the series of this case no longer; nothing is stored");
  }
  if (!absl::IsFailedPrecondition(fetched) && !absl::IsUnimplemented(fetched)) return fetched;
  // It gives nobody anything: what was kept stands for it, for a while.
  const int64_t age_s = std::time(nullptr) - series.first_s;
  if (!series.has_header || age_s > known.lifetime.count()) {
    return absl::FailedPreconditionError(
        "the PACS gives no header, and none is kept any longer; have it send the series again");
  }
  fs::copy_file(known.kept, path, ignored);
  return ignored ? FileError(ignored.value(), "cannot copy the header to", path) : absl::OkStatus();
}

std::string WhatHasChanged(const PatientIdentity& seen, const PatientIdentity& now) {
  if (!now.readable) {
    return "the name is in a character set that is not known here; compare with the PACS";
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
